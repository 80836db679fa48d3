//! The secret in the address.

use particlegs_core::{Error, Result};
use std::sync::{Mutex, PoisonError};

/// Minimum length of a token chosen by the user.
const SHORTEST: usize = 32;
/// Maximum length: it has to fit into an address.
const LONGEST: usize = 256;

/// The secret of an address.
#[derive(Clone, Debug)]
pub struct Token(String);

impl Token {
    /// A token chosen by the user.
    pub fn chosen(token: String) -> Result<Self> {
        let fits = (SHORTEST..=LONGEST).contains(&token.len()) && token.bytes().all(|b| b.is_ascii_alphanumeric());
        let message = format!("a token is {SHORTEST} to {LONGEST} letters and digits");
        if fits { Ok(Token(token)) } else { Err(Error::argument(message)) }
    }

    /// A token of 128 random bits.
    pub fn random() -> Result<Self> {
        let mut bits = [0; 16];
        getrandom::fill(&mut bits).map_err(|e| Error::io("random numbers", std::io::Error::other(e.to_string())))?;
        Ok(Token(bits.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Its text, hexadecimal.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares in constant time.
    fn is(&self, key: &str) -> bool {
        let pairs = self.0.bytes().zip(key.bytes());
        self.0.len() == key.len() && pairs.fold(0, |differ, (x, y)| differ | (x ^ y)) == 0
    }
}

pub struct TokenAuth {
    token: Token,
    /// A token that works once and redirects to the other.
    once: Mutex<Option<Token>>,
}

/// Access that the first part of a path gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathAccess {
    Everything,
    /// One redirect to the token.
    Once,
    Nothing,
}

impl TokenAuth {
    pub fn new(token: Token) -> Self {
        TokenAuth { token, once: Mutex::default() }
    }

    pub fn token(&self) -> &str {
        self.token.as_str()
    }

    /// A new token that works once; it replaces the one before.
    pub fn for_once(&self) -> Result<Token> {
        let token = Token::random()?;
        *self.once.lock().unwrap_or_else(PoisonError::into_inner) = Some(token.clone());
        Ok(token)
    }

    /// The access that `key` gives; a token that works once is then used up.
    pub fn opens(&self, key: &str) -> PathAccess {
        if self.token.is(key) {
            return PathAccess::Everything;
        }
        let mut once = self.once.lock().unwrap_or_else(PoisonError::into_inner);
        match once.take_if(|token| token.is(key)) {
            Some(_) => PathAccess::Once,
            None => PathAccess::Nothing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_random_and_open_as_often_as_they_should() {
        let [door, other] = [(); 2].map(|()| TokenAuth::new(Token::random().unwrap()));
        assert_eq!((door.token().len(), door.token() == other.token()), (32, false));
        for wrong in ["", "0", other.token(), &door.token()[1..], &format!("{}0", door.token())] {
            assert_eq!(door.opens(wrong), PathAccess::Nothing, "{wrong}");
        }
        let once = door.for_once().unwrap();
        let known = |key: &str| [(); 2].map(|()| door.opens(key));
        assert_eq!(known(once.as_str()), [PathAccess::Once, PathAccess::Nothing]);
        assert_eq!(known(door.token()), [PathAccess::Everything; 2]);
    }

    #[test]
    fn tokens_that_could_be_guessed_or_do_not_fit_an_address_are_refused() {
        let chosen = "0123456789abcdefABCDEF0123456789";
        assert_eq!(Token::chosen(chosen.into()).unwrap().as_str(), chosen);
        for bad in ["", "secret", &chosen[1..], &format!("{chosen}/"), &format!("{chosen}ä"), &"a".repeat(257)] {
            assert!(Token::chosen(bad.to_string()).is_err(), "{bad}");
        }
    }
}
