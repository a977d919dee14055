//! The median that needs no arithmetic: one of the values themselves.

use std::cmp::Ordering;

/// The median of `values`, of an even count the upper of the two middle values, by a total `order`
/// (`f32::total_cmp`, `f64::total_cmp`); `None` of nothing. Reorders `values`.
pub fn upper_median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
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
