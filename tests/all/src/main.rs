//! Runs all tests of the workspace, and prints their total after the totals of each test binary.
//!
//! `cargo test-all` is its short name. Arguments such as `--locked` are passed to `cargo test`.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Command, ExitCode, Stdio};

fn main() -> io::Result<ExitCode> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut test = Command::new(cargo)
        .args(["test", "--workspace", "--no-fail-fast"])
        .args(std::env::args_os().skip(1))
        .stdout(Stdio::piped())
        .spawn()?;
    let mut totals = Totals::default();
    let mut output = io::stdout().lock();
    for line in BufReader::new(test.stdout.take().expect("it is piped")).lines() {
        let line = line?;
        totals.add(&line);
        writeln!(output, "{line}")?;
    }
    let status = test.wait()?;
    let Totals { binaries, passed, failed, ignored } = totals;
    writeln!(output, "{binaries} test binaries: {passed} passed, {failed} failed, {ignored} ignored")?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

#[derive(Default)]
struct Totals {
    binaries: u64,
    passed: u64,
    failed: u64,
    ignored: u64,
}

impl Totals {
    /// Adds a line such as "test result: ok. 84 passed; 0 failed; 2 ignored; ...".
    fn add(&mut self, line: &str) {
        let Some(counts) = line.strip_prefix("test result: ") else { return };
        self.binaries += 1;
        let words: Vec<&str> = counts.split([' ', ';']).filter(|word| !word.is_empty()).collect();
        for pair in words.windows(2) {
            let Ok(count) = pair[0].parse::<u64>() else { continue };
            match pair[1] {
                "passed" => self.passed += count,
                "failed" => self.failed += count,
                "ignored" => self.ignored += count,
                _ => {}
            }
        }
    }
}
