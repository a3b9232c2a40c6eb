//! Rigid motions of one frame with respect to another.

use crate::error::KinematicsError;

/// How far R^T R of a given transform may be from the identity: loose enough for numbers of nine digits.
pub(crate) const RIGID_TOLERANCE: f64 = 1e-8;

/// A rigid motion `a_from_b`: a point in b is `rotation * point + translation` in a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Rotation matrix, row-major.
    pub rotation: [f64; 9],
    /// Origin of b in a, metres.
    pub translation: [f64; 3],
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// No motion.
    pub const IDENTITY: Transform =
        Transform { rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], translation: [0.0; 3] };

    /// A rotation by a rotation vector (axis times angle, radians), then a translation (metres).
    pub fn from_rotation_vector(rotation_vector: [f64; 3], translation: [f64; 3]) -> Transform {
        Transform { rotation: rotation_exp(rotation_vector), translation }
    }

    /// From a homogeneous 4x4 matrix, row-major; the last row is not looked at.
    pub fn from_matrix(m: &[f64; 16]) -> Transform {
        Transform {
            rotation: [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]],
            translation: [m[3], m[7], m[11]],
        }
    }

    /// The homogeneous 4x4 matrix, row-major.
    pub fn to_matrix(&self) -> [f64; 16] {
        let (r, t) = (&self.rotation, &self.translation);
        [r[0], r[1], r[2], t[0], r[3], r[4], r[5], t[1], r[6], r[7], r[8], t[2], 0.0, 0.0, 0.0, 1.0]
    }

    /// The rotation as a rotation vector, its length between 0 and pi.
    pub fn rotation_vector(&self) -> [f64; 3] {
        rotation_log(&self.rotation)
    }

    /// A point in b, in a.
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        let rotated = self.rotate(point);
        [0, 1, 2].map(|i| rotated[i] + self.translation[i])
    }

    /// A direction in b, in a.
    pub fn rotate(&self, direction: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|i| (0..3).map(|k| r[3 * i + k] * direction[k]).sum())
    }

    /// `a_from_b.compose(b_from_c)` is `a_from_c`.
    pub fn compose(&self, other: &Transform) -> Transform {
        let mut rotation = [0.0; 9];
        for (index, value) in rotation.iter_mut().enumerate() {
            let (i, j) = (index / 3, index % 3);
            *value = (0..3).map(|k| self.rotation[3 * i + k] * other.rotation[3 * k + j]).sum();
        }
        Transform { rotation, translation: self.apply(other.translation) }
    }

    /// `b_from_a`.
    pub fn inverse(&self) -> Transform {
        let r = &self.rotation;
        let back = Transform {
            rotation: [r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]],
            translation: [0.0; 3],
        };
        let moved = back.rotate(self.translation);
        Transform { translation: moved.map(|x| -x), ..back }
    }

    /// Check that this is a rigid motion; `name` is for the message.
    ///
    /// # Errors
    /// [`KinematicsError::NotRigid`] if the rotation is not orthonormal, mirrors, or a number is not finite.
    pub fn check(&self, name: &'static str) -> Result<(), KinematicsError> {
        let r = &self.rotation;
        let mut deviation = 0.0_f64;
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            let dot: f64 = (0..3).map(|k| r[3 * k + i] * r[3 * k + j]).sum();
            deviation = deviation.max((dot - f64::from(u8::from(i == j))).abs());
        }
        let determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
            + r[2] * (r[3] * r[7] - r[4] * r[6]);
        let finite = r.iter().chain(&self.translation).all(|x| x.is_finite());
        if finite && deviation <= RIGID_TOLERANCE && determinant > 0.0 {
            return Ok(());
        }
        Err(KinematicsError::NotRigid { name, deviation })
    }
}

/// Rotation matrix (row-major) of a rotation vector (Rodrigues).
pub fn rotation_exp(w: [f64; 3]) -> [f64; 9] {
    let [x, y, z] = w;
    let square = x * x + y * y + z * z;
    let angle = square.sqrt();
    let sinc = if square < 1e-16 { 1.0 - square / 6.0 } else { angle.sin() / angle };
    let half = if square < 1e-16 { 1.0 } else { (0.5 * angle).sin() / (0.5 * angle) };
    let k = 0.5 * half * half;
    [
        1.0 - k * (y * y + z * z),
        k * x * y - sinc * z,
        k * x * z + sinc * y,
        k * x * y + sinc * z,
        1.0 - k * (x * x + z * z),
        k * y * z - sinc * x,
        k * x * z - sinc * y,
        k * y * z + sinc * x,
        1.0 - k * (x * x + y * y),
    ]
}

/// Rotation vector of a rotation matrix (row-major), its length between 0 and pi.
///
/// Goes by the unit quaternion with its largest component taken from the diagonal, which keeps all digits
/// at small angles and near half a turn.
pub fn rotation_log(r: &[f64; 9]) -> [f64; 3] {
    let q = quaternion(r);
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    let vector = [q[1] * sign, q[2] * sign, q[3] * sign];
    let sine = (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]).sqrt();
    let cosine = q[0] * sign;
    let scale = if sine < 1e-9 { 2.0 / cosine } else { 2.0 * sine.atan2(cosine) / sine };
    vector.map(|x| x * scale)
}

/// Unit quaternion w x y z of a rotation matrix, of either sign.
fn quaternion(r: &[f64; 9]) -> [f64; 4] {
    let squares =
        [r[0] + r[4] + r[8], r[0] - r[4] - r[8], r[4] - r[0] - r[8], r[8] - r[0] - r[4]].map(|x| 1.0 + x);
    let largest = (1..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let (xy, xz, yz) = (r[1] + r[3], r[2] + r[6], r[5] + r[7]);
    let (wx, wy, wz) = (r[7] - r[5], r[2] - r[6], r[3] - r[1]);
    let raw = match largest {
        0 => [squares[0], wx, wy, wz],
        1 => [wx, squares[1], xy, xz],
        2 => [wy, xy, squares[2], yz],
        _ => [wz, xz, yz, squares[3]],
    };
    let norm = raw.iter().map(|x| x * x).sum::<f64>().sqrt();
    raw.map(|x| x / norm)
}
