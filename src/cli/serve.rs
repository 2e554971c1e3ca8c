//! `splitsnow serve`: the web page with the engine of this machine.
use super::common::{self, ThreadArgs};
use crate::serve::Server;

/// Show the web page, with the engine of this machine
///
/// Prints the address of the page and answers it until Ctrl-C. The page is the same that
/// computes by itself in a browser; here it computes on all processors of this machine. The
/// server listens on 127.0.0.1 only, and its address holds a random token: whoever has the
/// address can use the page. Nothing is read from the disk or written to it.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow serve --port 8080
  splitsnow serve --threads 2")]
pub(super) struct Args {
    /// Port of 127.0.0.1 [default: any free one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    #[command(flatten)]
    threads: ThreadArgs,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    // before the address is printed: whoever reads it may end the server
    let stop = common::interrupt_flag()?;
    let server = Server::bind(args.port.unwrap_or(0), args.threads.count()?)?;
    common::note("open this address in a browser; Ctrl-C ends the server");
    common::print(&format!("{}\n", server.url()))?;
    Ok(server.run(stop)?)
}
