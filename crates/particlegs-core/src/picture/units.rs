//! Units as journals print them: `Msun/h / (Mpc/h)²` as `M⊙ h Mpc⁻²`.

/// A whole number in superscript digits.
pub fn superscript(n: i32) -> String {
    n.to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            d => char::from_u32(0x2070 + (d as u32 - '0' as u32)).unwrap_or(d),
        })
        .collect()
}

/// A unit in powers, as a journal prints it. One that is not made of names, powers, products and quotients is
/// left as it is.
pub fn journal_unit(unit: &str) -> String {
    let mut factors = UnitFactors::default();
    match factors.product(&mut UnitParser { rest: unit, depth: 0 }, 1) {
        Some(()) => factors.text(),
        None => unit.trim().to_string(),
    }
}

/// Most characters of a unit, and most brackets within one another.
const LONGEST: usize = 200;
const DEEPEST: u32 = 16;

/// Numbers and names with their powers, in the order in which they come first.
#[derive(Default)]
struct UnitFactors {
    powers: Vec<(String, i32)>,
}

struct UnitParser<'a> {
    rest: &'a str,
    depth: u32,
}

impl UnitParser<'_> {
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn next(&mut self) {
        let mut letters = self.rest.chars();
        letters.next();
        self.rest = letters.as_str();
    }

    fn while_is(&mut self, is: impl Fn(char) -> bool) -> String {
        let end = self.rest.find(|c| !is(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word.to_string()
    }

    /// `^-2`, `**2`, `⁻²`, or a digit behind a name: none is 1.
    fn power(&mut self) -> Option<i32> {
        let plain = |c: char| match c {
            '⁻' => '-',
            '¹' => '1',
            '²' => '2',
            '³' => '3',
            c if ('⁰'..='⁹').contains(&c) => char::from_digit(c as u32 - '⁰' as u32, 10).unwrap_or(c),
            c => c,
        };
        let raised = self.while_is(|c| "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".contains(c));
        if !raised.is_empty() {
            return raised.chars().map(plain).collect::<String>().parse().ok();
        }
        let marked = self.rest.strip_prefix("**").or(self.rest.strip_prefix('^'));
        if let Some(rest) = marked {
            self.rest = rest;
        }
        let digits = self.while_is(|c| c.is_ascii_digit() || c == '-' || c == '+');
        match (digits.is_empty(), marked) {
            (true, None) => Some(1),
            (true, Some(_)) => None,
            _ => digits.parse().ok(),
        }
    }
}

impl UnitFactors {
    /// Reads a product up to its end or a closing bracket.
    fn product(&mut self, l: &mut UnitParser<'_>, sign: i32) -> Option<()> {
        // Brackets are read by recursion, so a foreign text could otherwise exhaust the stack.
        if l.rest.len() > LONGEST || l.depth > DEEPEST {
            return None;
        }
        let mut side = sign;
        loop {
            match l.peek() {
                None => return (l.depth == 0).then_some(()),
                Some(')') => return (l.depth > 0).then_some(()),
                Some('/') => {
                    l.next();
                    side = -sign;
                    self.factor(l, side)?;
                }
                Some('*' | '·' | '×') => {
                    l.next();
                    self.factor(l, side)?;
                }
                Some(_) => {
                    side = if self.powers.is_empty() { sign } else { side };
                    self.factor(l, side)?;
                }
            }
            // What follows a quotient without a sign between is a factor again: a/b c = a b⁻¹ c.
            side = sign;
        }
    }

    fn factor(&mut self, l: &mut UnitParser<'_>, sign: i32) -> Option<()> {
        match l.peek()? {
            '(' => {
                l.next();
                let mut inner = UnitFactors::default();
                l.depth += 1;
                inner.product(l, 1)?;
                l.depth -= 1;
                l.next();
                let power = sign.checked_mul(l.power()?)?;
                inner.powers.into_iter().try_for_each(|(name, p)| self.add(name, p.checked_mul(power)?))
            }
            c if c.is_ascii_digit() => {
                let number = l.while_is(|c| c.is_ascii_digit() || c == '.' || c == 'e' || c == 'E');
                let (front, exponent) = number.split_once(['e', 'E']).unwrap_or((&number, "0"));
                let exponent: i32 = exponent.parse().ok()?;
                let power = l.power()?;
                match front {
                    "1" if exponent == 0 => Some(()),
                    "1" => self.add("10".into(), sign.checked_mul(exponent.checked_mul(power)?)?),
                    _ if exponent == 0 => self.add(front.into(), sign.checked_mul(power)?),
                    _ => None,
                }
            }
            c if c.is_alphabetic() || c == '☉' || c == '⊙' || c == '_' => {
                let name = l.while_is(|c| c.is_alphabetic() || c == '☉' || c == '⊙' || c == '_');
                let name = match &name[..] {
                    "Msun" | "M_sun" | "Msol" | "M☉" => "M⊙".to_string(),
                    _ => name,
                };
                self.add(name, sign.checked_mul(l.power()?)?)
            }
            _ => None,
        }
    }

    fn add(&mut self, name: String, power: i32) -> Option<()> {
        match self.powers.iter_mut().find(|(n, _)| *n == name) {
            Some((_, p)) => *p = p.checked_add(power)?,
            None => self.powers.push((name, power)),
        }
        Some(())
    }

    fn text(&self) -> String {
        let one = |(name, power): &(String, i32)| match power {
            0 => None,
            1 => Some(name.clone()),
            p => Some(format!("{name}{}", superscript(*p))),
        };
        self.powers.iter().filter_map(one).collect::<Vec<_>>().join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_as_a_journal_prints_them() {
        for (given, printed) in [
            ("Mpc/h", "Mpc h⁻¹"),
            ("Msun/h / (Mpc/h)²", "M⊙ h Mpc⁻²"),
            ("10^10 Msun/h / (Mpc/h)²", "10¹⁰ M⊙ h Mpc⁻²"),
            ("1e10 Msun", "10¹⁰ M⊙"),
            ("kpc", "kpc"),
            ("particles / (Mpc/h)²", "particles Mpc⁻² h²"),
            ("particles / Å²", "particles Å⁻²"),
            ("g cm^-3", "g cm⁻³"),
            ("", ""),
            ("comoving Mpc/h", "comoving Mpc h⁻¹"),
            ("what? %", "what? %"),
            ("((((((((((((((((((((((m", "((((((((((((((((((((((m"),
            ("m^99999999999", "m^99999999999"),
            ("m)", "m)"),
        ] {
            assert_eq!(journal_unit(given), printed, "{given}");
        }
    }
}
