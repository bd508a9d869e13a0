//! Orthonormal shading frames.

use super::{Vec3, vec3};

/// A right-handed orthonormal frame; in local coordinates the normal is +z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, local x.
    pub s: Vec3,
    /// Second tangent, local y.
    pub t: Vec3,
    /// Normal, local z.
    pub n: Vec3,
}

impl Frame {
    /// Any frame around the unit vector `n` (Duff et al. 2017, listing 3): continuous except at n.z = 0.
    pub fn around(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        let s = vec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
        let t = vec3(b, sign + n.y * n.y * a, -n.y);
        Self { s, t, n }
    }

    /// The frame around `n` whose x axis follows `tangent` as closely as it can.
    pub fn along(n: Vec3, tangent: Vec3) -> Self {
        let across = tangent - n * n.dot(tangent);
        // What is left of a tangent along the normal is rounding alone.
        if across.length_squared() > 1e-8 * tangent.length_squared() {
            let s = across.normalize();
            Self { s, t: n.cross(s), n }
        } else {
            Self::around(n)
        }
    }

    /// World to local.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        vec3(self.s.dot(v), self.t.dot(v), self.n.dot(v))
    }

    /// Local to world.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_right_handed_and_invertible() {
        let directions = [vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0), vec3(1.0, 0.0, 0.0), vec3(-0.3, 0.8, -0.2)];
        for n in directions.map(Vec3::normalize) {
            for frame in [Frame::around(n), Frame::along(n, vec3(0.3, 0.2, 0.9)), Frame::along(n, n)] {
                assert!(frame.s.cross(frame.t).distance(frame.n) < 1e-6);
                assert!((frame.s.length() - 1.0).abs() < 1e-6 && frame.s.dot(n).abs() < 1e-6);
                let v = vec3(0.1, -2.0, 3.0);
                assert!(frame.to_world(frame.to_local(v)).distance(v) < 1e-5);
            }
        }
    }
}
