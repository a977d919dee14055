//! Numbers as a person reads them.

/// A value in a unit that suits it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unit {
    /// What to multiply metres or radians by.
    pub factor: f64,
    /// Its sign.
    pub name: &'static str,
}

impl Unit {
    /// A value that is in this unit already, with the unit's sign.
    pub(crate) fn show(&self, value: f64, digits: i32) -> String {
        // The degree sign follows its number without a space.
        let space = if self.name == DEGREES.name { "" } else { "\u{a0}" };
        format!("{}{space}{}", significant(value, digits), self.name)
    }
}

/// Degrees, from radians.
pub(crate) const DEGREES: Unit = Unit { factor: 180.0 / std::f64::consts::PI, name: "°" };

/// Millimetres, metres or kilometres, whichever suits lengths up to `largest_m`.
pub(crate) fn length(largest_m: f64) -> Unit {
    match largest_m {
        m if m < 0.5 => Unit { factor: 1e3, name: "mm" },
        m if m < 5e3 || !m.is_finite() => Unit { factor: 1.0, name: "m" },
        _ => Unit { factor: 1e-3, name: "km" },
    }
}

/// `value` to `digits` significant digits, with a true minus sign; a dash if it is not finite.
pub(crate) fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    // Of the rounded value: 99.97 is 100, not 100.0.
    let rounded = format!("{value:.*e}", (digits - 1).max(0) as usize);
    let magnitude = rounded.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if !(-5..9).contains(&magnitude) {
        return rounded.replace('-', "−");
    }
    fixed(value, (digits - 1 - magnitude).max(0) as usize)
}

/// `value` with that many decimals and a true minus sign; a dash if it is not finite.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{value:.decimals$}");
    // A rounded −0 has no sign to show.
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("−{rest}"),
        Some(rest) => rest.to_owned(),
        None => text,
    }
}

/// The label of a tick: with that many decimals, or as 2·10⁻⁶ where that would be long.
pub(crate) fn tick(value: f64, decimals: usize) -> String {
    let exponent = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    if value == 0.0 || (decimals <= 4 && exponent < 6) || !value.is_finite() {
        return fixed(value, if value == 0.0 && decimals > 4 { 0 } else { decimals });
    }
    // Rounded first: 9.9999…·10⁻⁷ is 10⁻⁶.
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.').replace('-', "−");
    let power: String = exponent.chars().map(superscript).collect();
    match mantissa.as_str() {
        "1" => format!("10{power}"),
        "−1" => format!("−10{power}"),
        _ => format!("{mantissa}·10{power}"),
    }
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32(0x2070 + (u32::from(digit) - u32::from('0'))).unwrap_or(digit),
        other => other,
    }
}

/// `value ± sigma`, both with the decimals that show two digits of σ, at most six.
pub(crate) fn with_sigma(value: f64, sigma: f64) -> String {
    if !(sigma.is_finite() && sigma > 0.0) {
        return significant(value, 4);
    }
    let decimals = (1 - sigma.log10().floor() as i32).clamp(0, 6) as usize;
    format!("{} ± {}", fixed(value, decimals), fixed(sigma, decimals))
}

/// A number of things with its noun.
pub fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(significant(0.012345, 2), "0.012");
        assert_eq!(significant(-1234.5, 3), "−1234");
        assert_eq!([significant(99.97, 3), significant(0.0, 3)], ["100", "0.00"]);
        assert_eq!(significant(f64::NAN, 3), "–");
        assert_eq!(significant(3.2e-9, 2), "3.2e−9");
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(with_sigma(-47.1234, 0.0213), "−47.123 ± 0.021");
        assert_eq!(with_sigma(1.5, f64::INFINITY), "1.500");
        assert_eq!(DEGREES.show(1.5, 2), "1.5°");
        assert_eq!([tick(0.025, 3), tick(1e-6, 6), tick(-2.5e-12, 13)], ["0.025", "10⁻⁶", "−2.5·10⁻¹²"]);
        assert_eq!([tick(0.0, 7), tick(9.999_999_999e-8, 8), tick(2e6, 0)], ["0", "10⁻⁷", "2·10⁶"]);
        assert_eq!(length(0.02).show(20.0, 2), "20\u{a0}mm");
    }
}
