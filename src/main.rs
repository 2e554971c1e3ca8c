//! The `splitsnow` command.
fn main() -> anyhow::Result<()> {
    splitsnow::cli::run()
}
