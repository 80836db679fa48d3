//! A child process that answers requests. Requests and answers are sent as their length and their bytes.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Longest wait for the last words of an ended child: another process may hold its standard error.
const LAST_WORDS: Duration = Duration::from_millis(500);
/// Most characters of the last words.
const MOST_WORDS: usize = 300;

/// A child's answer.
pub enum ChildReply {
    Bytes(Vec<u8>),
    /// Why there are no bytes.
    Error(String),
    /// The missing packages.
    Missing(String),
}

/// A running child; dropping it kills it.
pub struct Child {
    process: std::process::Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    /// The last line of its standard error with text, and the thread that reads it.
    words: Arc<Mutex<String>>,
    listener: JoinHandle<()>,
}

impl Child {
    pub fn start(program: &Path, arguments: &[String]) -> io::Result<Child> {
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut process = command.spawn()?;
        let pipes = (process.stdin.take(), process.stdout.take(), process.stderr.take());
        let (Some(requests), Some(answers), Some(errors)) = pipes else {
            return Err(io::Error::other("its pipes could not be opened"));
        };
        let words = Arc::new(Mutex::new(String::new()));
        let heard = Arc::clone(&words);
        let listener = thread::spawn(move || {
            for line in BufReader::new(errors).split(b'\n').map_while(Result::ok) {
                let line = String::from_utf8_lossy(&line).trim().chars().take(MOST_WORDS).collect::<String>();
                if !line.is_empty() {
                    *heard.lock().unwrap_or_else(PoisonError::into_inner) = line;
                }
            }
        });
        Ok(Child { process, requests, answers: BufReader::new(answers), words, listener })
    }

    /// Sends a request in parts and reads the answer; the error says how the child failed. A thread of its own writes,
    /// so that a child which answers too early cannot cause a deadlock.
    pub fn ask(&mut self, parts: &[&[u8]]) -> Result<ChildReply, String> {
        let (requests, answers) = (&mut self.requests, &mut self.answers);
        thread::scope(|scope| {
            let length = parts.iter().map(|p| p.len() as u64).sum::<u64>();
            let writer = scope.spawn(move || {
                requests.write_all(&length.to_le_bytes())?;
                parts.iter().try_for_each(|p| requests.write_all(p))?;
                requests.flush()
            });
            let answer = read_answer(answers);
            if answer.is_err() {
                // After a wrong answer the child may not read on: kill it, so that the writer ends.
                let _ = self.process.kill();
            }
            let written = writer.join().unwrap_or_else(|_| Err(io::Error::other("the writer failed")));
            match (answer, written) {
                (Ok(answer), Ok(())) => Ok(answer),
                (Ok(_), Err(_)) => Err("it answered before it had read the request".into()),
                (Err(broken), _) => Err(broken),
            }
        })
    }

    /// Last words of a failed child, or its exit status where there are none.
    pub fn last_words(mut self) -> String {
        let _ = self.process.kill();
        let status = self.process.wait();
        let started = Instant::now();
        while !self.listener.is_finished() && started.elapsed() < LAST_WORDS {
            thread::sleep(Duration::from_millis(2));
        }
        let words = self.words.lock().unwrap_or_else(PoisonError::into_inner).clone();
        match (words.is_empty(), status) {
            (false, _) => words,
            (true, Ok(status)) => status.to_string(),
            (true, Err(error)) => error.to_string(),
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn read_answer(answers: &mut impl Read) -> Result<ChildReply, String> {
    let ended = |_| "it ended before it answered".to_string();
    let mut head = [0; 9];
    answers.read_exact(&mut head).map_err(ended)?;
    let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
    let kind: fn(Vec<u8>) -> ChildReply = match head[0] {
        b'K' => ChildReply::Bytes,
        b'E' => |text| ChildReply::Error(line(&text)),
        b'M' => |text| ChildReply::Missing(line(&text)),
        _ => return Err("the answer does not come from lab/compressors.py".into()),
    };
    // Allocate for the received bytes, not for the stated length.
    let mut bytes = Vec::new();
    let read = answers.take(length).read_to_end(&mut bytes);
    match read {
        Ok(n) if n as u64 == length => Ok(kind(bytes)),
        _ => Err("it ended in the middle of its answer".into()),
    }
}

fn line(text: &[u8]) -> String {
    String::from_utf8_lossy(text).split_whitespace().collect::<Vec<_>>().join(" ").chars().take(MOST_WORDS).collect()
}
