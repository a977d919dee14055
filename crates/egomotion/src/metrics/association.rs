//! Which pose of one trajectory belongs to which of another, by their time stamps.

/// Pairs (i, j) of time stamps nearest to each other and at most `most_s` apart, in seconds.
///
/// Each stamp of the shorter list takes the nearest of the longer one, the earlier of two that are equally near;
/// both lists increase.
pub fn associate(a_s: &[f64], b_s: &[f64], most_s: f64) -> Vec<(usize, usize)> {
    if b_s.len() < a_s.len() {
        return associate(b_s, a_s, most_s).into_iter().map(|(j, i)| (i, j)).collect();
    }
    let nearest = |(i, &time): (usize, &f64)| {
        let after = b_s.partition_point(|&b| b <= time);
        let candidates = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let distance = |j: usize| b_s.get(j).map(|b| ((b - time).abs(), j));
        let (distance, j) = candidates.filter_map(distance).min_by(|x, y| x.0.total_cmp(&y.0))?;
        (distance <= most_s).then_some((i, j))
    };
    a_s.iter().enumerate().filter_map(nearest).collect()
}
