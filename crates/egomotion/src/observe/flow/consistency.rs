//! Forward and backward flow must undo each other.

use super::Displacement;
use super::sampling::interpolate;
use crate::observe::planes::Planes;
use rayon::prelude::*;

/// Drop what the `backward` flow (in pixels of its level) does not bring back to within `tolerance`
/// pixels of where it began.
pub(super) fn reject(flow: &mut Planes<5>, backward: &Displacement, level: usize, tolerance: f32) {
    let scale = (1_usize << level) as f32;
    flow.strips(1).into_par_iter().enumerate().for_each(|(y, row)| {
        let [us, vs, uu, uv, vv] = row;
        for x in 0..us.len() {
            let (u, v) = (us[x], vs[x]);
            let (tx, ty) = ((x as f32 + u) / scale, (y as f32 + v) / scale);
            let du = u + scale * interpolate(&backward.u, tx, ty);
            let dv = v + scale * interpolate(&backward.v, tx, ty);
            let agrees = du * du + dv * dv <= tolerance * tolerance;
            if !agrees {
                (us[x], vs[x], uu[x], uv[x], vv[x]) = (f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;

    #[test]
    fn what_is_not_brought_back_is_dropped() {
        let mut flow = Planes::<5>::filled(8, 8, 2.0);
        let back = Grid::from_fn(4, 4, |x, _| if x < 2 { -1.0 } else { 1.0 });
        reject(&mut flow, &Displacement { u: back, v: Grid::filled(4, 4, -1.0) }, 1, 0.5);
        assert_eq!(flow.at(0, 0, 3), 2.0);
        assert!(flow.at(0, 4, 3).is_nan() && flow.at(2, 4, 3).is_nan());
    }
}
