//! Medians and quantiles of samples.

use std::cmp::Ordering;

/// The median; of an even count the mean of the two middle values. NaN for no values. Reorders `values`.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        upper
    } else {
        let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        0.5 * (lower + upper)
    }
}

/// The median of `values`, of an even count the upper of the two middle values, by a total `order`
/// (`f32::total_cmp`, `f64::total_cmp`); `None` of nothing. Reorders `values`.
pub fn upper_median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// The `q` quantile (0 … 1), interpolated linearly between the sorted values; `None` if there are none.
///
/// At ½ it is the median, with the mean of the two middle values of an even count.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = q.clamp(0.0, 1.0) * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[(at.ceil() as usize).min(last)]);
    Some(if low == high { low } else { low + (high - low) * at.fract() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_middle_value_or_the_upper_of_two() {
        let of = |values: &[f64]| upper_median(&mut values.to_vec(), f64::total_cmp);
        assert_eq!((of(&[3.0, 1.0, 2.0]), of(&[4.0, 1.0, 3.0, 2.0]), of(&[])), (Some(2.0), Some(3.0), None));
    }
}
