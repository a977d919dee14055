//! `motion.parquet`: the rows of `motion.csv`, where the build can write it.

use tempfile::TempDir;

use crate::process::{assert_refused, names, try_run};
use crate::recording::recording;

#[test]
fn motion_as_parquet_or_the_feature_that_is_missing() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let ended = try_run(recording(), &out, "--frames 3 --observe sparse --quiet --parquet");
    if cfg!(not(feature = "parquet")) {
        assert_refused(&ended, 2, &["--parquet is not in this build", "--features parquet"]);
        assert!(!out.exists());
        return;
    }
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(names(&out).contains(&"motion.parquet".to_owned()));
    #[cfg(feature = "parquet")]
    {
        let rows = egomotion_io::motion_table::read(&out.join("motion.csv")).unwrap();
        let expected = egomotion_io::motion_parquet::encode(&rows).unwrap();
        assert!(std::fs::read(out.join("motion.parquet")).unwrap() == expected);
    }
}
