//! The real program, serving: started, asked over a socket, stopped by a signal.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_spao-server");

/// Longest time that anything here may take, on a slow machine that is busy.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// A running server, killed when the test ends early.
pub(crate) struct Process {
    child: Child,
    pub(crate) address: String,
    /// The lines for people.
    pub(crate) lines: Vec<String>,
    /// Reads the log, so that the server never waits for a reader.
    log: Option<JoinHandle<String>>,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Process {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        Self::start_with(arguments, &[])
    }

    /// With these variables in its environment.
    pub(crate) fn start_with(arguments: &[&str], environment: &[(&str, &str)]) -> Self {
        let mut child = Command::new(PROGRAM)
            .args(["serve", "--addr", "127.0.0.1:0"])
            .args(arguments)
            .env_remove("RUST_LOG")
            .env_remove("SPAO_API_KEYS")
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut stderr = child.stderr.take().expect("it is piped");
        let log = std::thread::spawn(move || {
            let mut log = String::new();
            stderr.read_to_string(&mut log).expect("the log is text");
            log
        });
        let stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        let lines: Vec<String> = stdout.lines().map_while(Result::ok).take(3).collect();
        let address = lines.first().and_then(|line| line.strip_prefix("Listening on http://")).unwrap_or_default();
        let process = Self { address: address.to_owned(), child, lines, log: Some(log) };
        assert!(process.address.starts_with("127.0.0.1:"), "{:?}", process.lines);
        process
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> Value {
        let request = ureq::post(self.url(path)).header("content-type", "application/json");
        json_of(request.send(body.to_string()), path)
    }

    pub(crate) fn patch(&self, path: &str, body: &Value) -> Value {
        let request = ureq::patch(self.url(path)).header("content-type", "application/json");
        json_of(request.send(body.to_string()), path)
    }

    pub(crate) fn delete(&self, path: &str) {
        ureq::delete(self.url(path)).call().unwrap_or_else(|error| panic!("{path}: {error}"));
    }

    pub(crate) fn get(&self, path: &str) -> Vec<u8> {
        let mut answer = ureq::get(self.url(path)).call().unwrap_or_else(|error| panic!("{path}: {error}"));
        answer.body_mut().read_to_vec().expect("a body")
    }

    pub(crate) fn get_json(&self, path: &str) -> Value {
        serde_json::from_slice(&self.get(path)).expect("JSON")
    }

    /// Bytes of memory that the program has now.
    pub(crate) fn resident_bytes(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("it runs");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("the kernel tells");
        line.trim().trim_end_matches(" kB").parse::<u64>().expect("a number") * 1024
    }

    /// Sends a signal.
    pub(crate) fn signal(&self, signal: &str) {
        let id = self.child.id().to_string();
        let killed = Command::new("kill").args([signal, &id]).status().expect("kill is there");
        assert!(killed.success());
    }

    /// Sends a signal and waits; the exit status and the log.
    pub(crate) fn stop(self, signal: &str) -> (ExitStatus, String) {
        self.signal(signal);
        self.ended()
    }

    /// Waits for the end; the exit status and the log.
    pub(crate) fn ended(mut self) -> (ExitStatus, String) {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("it can be waited for") {
                break status;
            }
            assert!(Instant::now() < deadline, "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        };
        let log = self.log.take().expect("only the end takes it").join().expect("the log is text");
        (status, log)
    }

    /// Ends the server, which must have had nothing to complain about.
    pub(crate) fn stop_clean(self) {
        let (status, log) = self.stop("-TERM");
        assert_eq!(status.code(), Some(0), "{log}");
        assert_eq!(alarms(&log), Vec::<&str>::new());
    }
}

fn json_of(answer: Result<ureq::http::Response<ureq::Body>, ureq::Error>, path: &str) -> Value {
    let mut answer = answer.unwrap_or_else(|error| panic!("{path}: {error}"));
    let text = answer.body_mut().read_to_string().expect("a text");
    serde_json::from_str(&text).expect("JSON")
}

/// Lines of a log that should not be there in normal operation.
pub(crate) fn alarms(log: &str) -> Vec<&str> {
    log.lines().filter(|line| line.contains(" WARN ") || line.contains(" ERROR ")).collect()
}
