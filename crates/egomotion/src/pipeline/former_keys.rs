//! Keys of the configuration that had another name, or are settings no more.

/// Keys that have another name now.
const RENAMED: [(&[&str], &str); 4] = [
    (&["window"], "write vehicle instead"),
    (&["disparity", "area", "radius"], "write disparity.expert.area_radius_px instead"),
    (&["disparity", "area", "uniqueness"], "write disparity.expert.area_uniqueness instead"),
    (&["disparity", "area", "texture"], "write disparity.expert.area_texture instead"),
];

/// Keys of what is a constant now.
const CONSTANTS: [&[&str]; 17] = [
    &["disparity", "area", "left_right_tolerance"],
    &["disparity", "census"],
    &["disparity", "penalty_small"],
    &["disparity", "penalty_large"],
    &["disparity", "penalty_large_least"],
    &["disparity", "edge_contrast"],
    &["disparity", "left_right_tolerance"],
    &["disparity", "speckle_range"],
    &["disparity", "refinement_steps"],
    &["flow", "patch_stride_px"],
    &["flow", "search_iterations"],
    &["flow", "propagation_rounds"],
    &["flow", "finest_search_level"],
    &["flow", "refine_iterations"],
    &["flow", "noise_floor"],
    &["flow", "sigma_floor_px"],
    &["flow", "consistency_level"],
];

/// What to do about a key that the configuration no longer has, as `["window"]`; `None` for every other key.
///
/// It completes "there is no key window any more: …".
pub fn former_key_advice(path: &[&str]) -> Option<&'static str> {
    let renamed = RENAMED.iter().find(|(old, _)| *old == path).map(|(_, advice)| *advice);
    renamed.or(CONSTANTS.contains(&path).then_some("leave it out, it is a constant now"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn former_keys_are_answered_and_others_are_not() {
        assert_eq!(former_key_advice(&["window"]), Some("write vehicle instead"));
        assert!(former_key_advice(&["flow", "noise_floor"]).unwrap().contains("constant"));
        // The table is looked into: its keys have new places.
        for path in
            [&["disparity", "area"][..], &["disparity", "levels"], &["tracks", "window"], &["vehicle"]]
        {
            assert_eq!(former_key_advice(path), None, "{path:?}");
        }
        assert!(
            former_key_advice(&["disparity", "area", "texture"]).unwrap().contains("expert.area_texture")
        );
    }
}
