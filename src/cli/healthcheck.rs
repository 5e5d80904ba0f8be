//! `healthcheck`: asks `/readyz`, for containers whose image holds nothing but this program.

use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream};
use std::process::ExitCode;
use std::time::Duration;

use crate::config::HealthcheckArgs;

/// A ready server answers at once.
const PATIENCE: Duration = Duration::from_secs(3);

/// Longest answer that is read.
const MAX_ANSWER: u64 = 4096;

pub(super) fn run(args: &HealthcheckArgs, out: &mut dyn Write) -> anyhow::Result<ExitCode> {
    let verdict = ask(args.addr);
    match &verdict {
        Ok(true) => writeln!(out, "ready")?,
        Ok(false) => writeln!(out, "not ready")?,
        Err(error) => writeln!(out, "not ready: {error}")?,
    }
    Ok(if matches!(verdict, Ok(true)) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// True when `/readyz` answers 200.
fn ask(addr: SocketAddr) -> std::io::Result<bool> {
    let ip = match addr.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    let addr = SocketAddr::new(ip, addr.port());
    let mut stream = TcpStream::connect_timeout(&addr, PATIENCE)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    write!(stream, "GET /readyz HTTP/1.1\r\nHost: {addr}\r\nConnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    stream.take(MAX_ANSWER).read_to_end(&mut answer)?;
    Ok(answer.starts_with(b"HTTP/1.1 200 "))
}
