//! Floats of sixteen bits, as high dynamic range images hold them.

/// The half float of a number, if it has one.
pub fn encode(value: f32) -> Option<u16> {
    let bits = value.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    let magnitude = f32::from_bits(bits & 0x7fff_ffff);
    // What is left after a scale by powers of two is exact, or the number has none.
    let scaled = (magnitude * f32::from_bits((127 - 112) << 23)).to_bits() >> 13;
    let half = sign | u16::try_from(scaled).ok().filter(|&half| half < 0x7c00)?;
    (decode(half).to_bits() == bits).then_some(half)
}

/// The number of a half float that is finite.
#[inline(always)]
pub fn decode(half: u16) -> f32 {
    let magnitude = f32::from_bits(u32::from(half & 0x7fff) << 13) * f32::from_bits((127 + 112) << 23);
    f32::from_bits(magnitude.to_bits() | u32::from(half & 0x8000) << 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_float_is_its_own_and_no_other_number_has_one() {
        for half in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(encode(decode(half)), Some(half), "{half:x}");
        }
        assert_eq!((decode(0x3c00), decode(0x7bff), decode(1)), (1.0, 65504.0, 5.960_464_5e-8));
        for value in [0.1, 65505.0, 65536.0, 1e-8, f32::INFINITY, f32::NAN, 1.000_1] {
            assert_eq!(encode(value), None, "{value}");
        }
    }
}
