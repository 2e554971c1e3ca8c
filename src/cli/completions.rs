//! `splitsnow completions`: completion scripts for shells.
use clap_complete::Shell;

use super::common;

/// Print the completion script of a shell
///
/// The script goes to standard output. Save it where the shell looks for completions.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow completions bash > ~/.local/share/bash-completion/completions/splitsnow
  splitsnow completions zsh > ~/.zfunc/_splitsnow
  splitsnow completions fish > ~/.config/fish/completions/splitsnow.fish")]
pub(super) struct Args {
    /// The shell
    shell: Shell,
}

pub(super) fn run(args: &Args, mut command: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "splitsnow", &mut script);
    common::print(&String::from_utf8(script)?)
}
