//! The secret in the address: without it nothing is there.

use particlegs::{Error, Result};
use std::sync::{Mutex, PoisonError};

/// Characters of a token that a user chooses, at least.
const SHORTEST: usize = 32;
/// Characters at most: an address has to hold it.
const LONGEST: usize = 256;

/// The secrets.
pub struct Door {
    token: String,
    /// One that opens once, and leads to the other.
    once: Mutex<Option<String>>,
}

/// What the first part of a path opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Opens {
    /// The server.
    Everything,
    /// The way to the token, this time.
    Once,
    /// Nothing.
    Nothing,
}

impl Door {
    /// With a token of the user's, or a random one.
    pub fn new(token: Option<String>) -> Result<Self> {
        let token = token.map_or_else(random, |token| {
            let fits = (SHORTEST..=LONGEST).contains(&token.len()) && token.bytes().all(|b| b.is_ascii_alphanumeric());
            let what = format!("a token is {SHORTEST} to {LONGEST} letters and digits, and no others");
            if fits { Ok(token) } else { Err(Error::argument(what)) }
        })?;
        Ok(Door { token, once: Mutex::default() })
    }

    pub fn token(&self) -> &str {
        &self.token
    }

    /// A new token that opens once; the one before it opens nothing any more.
    pub fn for_once(&self) -> Result<String> {
        let token = random()?;
        *self.once.lock().unwrap_or_else(PoisonError::into_inner) = Some(token.clone());
        Ok(token)
    }

    /// What `key` opens; the token for once is used up by it.
    pub fn opens(&self, key: &str) -> Opens {
        if same(key, &self.token) {
            return Opens::Everything;
        }
        let mut once = self.once.lock().unwrap_or_else(PoisonError::into_inner);
        match once.take_if(|token| same(key, token)) {
            Some(_) => Opens::Once,
            None => Opens::Nothing,
        }
    }
}

/// In a time that does not tell how far they agree.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (x, y)| differ | (x ^ y)) == 0
}

/// 128 random bits, as 32 digits.
fn random() -> Result<String> {
    let mut bits = [0; 16];
    getrandom::fill(&mut bits).map_err(|e| Error::io("random numbers", std::io::Error::other(e.to_string())))?;
    Ok(bits.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_random_and_open_as_often_as_they_should() {
        let door = Door::new(None).unwrap();
        let other = Door::new(None).unwrap();
        assert_eq!((door.token().len(), door.token() == other.token()), (32, false));
        for wrong in ["", "0", other.token(), &door.token()[1..], &format!("{}0", door.token())] {
            assert_eq!(door.opens(wrong), Opens::Nothing, "{wrong}");
        }
        let once = door.for_once().unwrap();
        let known = |key: &str| [(); 2].map(|()| door.opens(key));
        assert_eq!(known(&once), [Opens::Once, Opens::Nothing]);
        assert_eq!(known(door.token()), [Opens::Everything; 2]);
    }

    #[test]
    fn tokens_that_could_be_guessed_or_do_not_fit_an_address_are_refused() {
        let chosen = "0123456789abcdefABCDEF0123456789";
        assert_eq!(Door::new(Some(chosen.into())).unwrap().token(), chosen);
        for bad in ["", "secret", &chosen[1..], &format!("{chosen}/"), &format!("{chosen}ä"), &"a".repeat(257)] {
            assert!(Door::new(Some(bad.to_string())).is_err(), "{bad}");
        }
    }
}
