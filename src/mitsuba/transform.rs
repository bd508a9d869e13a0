//! The elements of `<transform>`, composed in double precision.

use glam::{DMat4, DVec3, DVec4};

use crate::error::{Result, SourceLoc};
use crate::math::Vec3;

/// Moves by `offset`.
pub fn translate(offset: Vec3) -> DMat4 {
    DMat4::from_translation(offset.as_dvec3())
}

/// Scales each axis.
pub fn scale(factors: Vec3) -> DMat4 {
    DMat4::from_scale(factors.as_dvec3())
}

/// Turns by `degrees` counter-clockwise about `axis`.
pub fn rotate(axis: Vec3, degrees: f64, loc: &SourceLoc) -> Result<DMat4> {
    let axis = axis.as_dvec3().try_normalize();
    let axis = axis.ok_or_else(|| loc.invalid("the rotation axis has length zero"))?;
    Ok(DMat4::from_axis_angle(axis, degrees.to_radians()))
}

/// A frame at `origin` that looks along +z to `target`, with +x to the left and +y as near to `up` as it can.
pub fn look_at(origin: Vec3, target: Vec3, up: Vec3, loc: &SourceLoc) -> Result<DMat4> {
    let [origin, target, up] = [origin, target, up].map(Vec3::as_dvec3);
    let forward = (target - origin).try_normalize();
    let forward = forward.ok_or_else(|| loc.invalid("`lookat` has its target at its origin"))?;
    let up = if up == DVec3::ZERO { forward.any_orthonormal_vector() } else { up };
    let left = up.cross(forward).try_normalize();
    let left = left.ok_or_else(|| loc.invalid("`lookat` has its up direction along its view direction"))?;
    let columns = [left, forward.cross(left), forward].map(|v| v.extend(0.0));
    Ok(DMat4::from_cols(columns[0], columns[1], columns[2], origin.extend(1.0)))
}

/// 16 numbers row by row; or 9, for the linear part alone.
pub fn matrix(numbers: &[f64], loc: &SourceLoc) -> Result<DMat4> {
    let row = |i: usize, n: usize| &numbers[i * n..(i + 1) * n];
    match numbers.len() {
        16 => {
            let rows = [0, 1, 2, 3].map(|i| DVec4::from_slice(row(i, 4)));
            Ok(DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose())
        }
        9 => {
            let rows = [0, 1, 2].map(|i| DVec3::from_slice(row(i, 3)).extend(0.0));
            Ok(DMat4::from_cols(rows[0], rows[1], rows[2], DVec4::W).transpose())
        }
        other => Err(loc.invalid(format!("a matrix has 16 or 9 numbers, not {other}"))),
    }
}

/// The steps applied one after the other, the first one first.
pub fn chain(steps: &[DMat4]) -> DMat4 {
    steps.iter().fold(DMat4::IDENTITY, |whole, step| *step * whole)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::math::vec3;

    #[test]
    fn steps_apply_in_reading_order() {
        let chained = chain(&[translate(Vec3::X), scale(Vec3::splat(2.0))]).as_mat4();
        assert_eq!(chained.transform_point3(Vec3::ZERO), vec3(2.0, 0.0, 0.0));
        let loc = SourceLoc::file(Path::new("t"));
        let turned = chain(&[rotate(Vec3::Z, 90.0, &loc).unwrap()]).as_mat4().transform_point3(Vec3::X);
        assert!(turned.distance(Vec3::Y) < 1e-6);
    }

    #[test]
    fn look_at_has_x_to_the_left() {
        let loc = SourceLoc::file(Path::new("t"));
        let frame = chain(&[look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, &loc).unwrap()]).as_mat4();
        assert!(frame.transform_vector3(Vec3::Z).distance(Vec3::NEG_Z) < 1e-6);
        assert!(frame.transform_vector3(Vec3::X).distance(Vec3::NEG_X) < 1e-6);
        assert!(look_at(Vec3::ZERO, Vec3::Y, Vec3::Y, &loc).is_err());
        assert!(matrix(&[1.0; 15], &loc).is_err());
    }
}
