//! Parameters of closures: the slots that they take up.

use super::facets::{Facets, Ggx, TRANSMITTANCE_TERMS, Transmittance};
use crate::math::lanes::{Lanes, Lanes3};

/// Something that takes up parameters of a closure.
pub trait Parameter<const N: usize> {
    /// Number of them.
    const SLOTS: usize;

    /// Reads it.
    fn load(from: &[Lanes<N>]) -> Self;

    /// Writes it.
    fn store(&self, to: &mut [Lanes<N>]);
}

impl<const N: usize> Parameter<N> for Lanes<N> {
    const SLOTS: usize = 1;

    #[inline(always)]
    fn load(from: &[Lanes<N>]) -> Self {
        from[0]
    }

    fn store(&self, to: &mut [Lanes<N>]) {
        to[0] = *self;
    }
}

impl<const N: usize> Parameter<N> for Lanes3<N> {
    const SLOTS: usize = 3;

    #[inline(always)]
    fn load(from: &[Lanes<N>]) -> Self {
        Self { x: from[0], y: from[1], z: from[2] }
    }

    fn store(&self, to: &mut [Lanes<N>]) {
        (to[0], to[1], to[2]) = (self.x, self.y, self.z);
    }
}

impl<const N: usize> Parameter<N> for Facets<N> {
    const SLOTS: usize = 2;

    /// The sign of the first roughness stands for the distribution.
    #[inline(always)]
    fn load(from: &[Lanes<N>]) -> Self {
        Self { ggx: from[0].less(Lanes::ZERO), alpha: [from[0].abs(), from[1]] }
    }

    fn store(&self, to: &mut [Lanes<N>]) {
        (to[0], to[1]) = (self.ggx.select(-self.alpha[0], self.alpha[0]), self.alpha[1]);
    }
}

impl<const N: usize> Parameter<N> for Ggx<N> {
    const SLOTS: usize = 2;

    #[inline(always)]
    fn load(from: &[Lanes<N>]) -> Self {
        Self { alpha: [from[0], from[1]] }
    }

    fn store(&self, to: &mut [Lanes<N>]) {
        [to[0], to[1]] = self.alpha;
    }
}

impl<const N: usize> Parameter<N> for Transmittance<N> {
    const SLOTS: usize = TRANSMITTANCE_TERMS;

    #[inline(always)]
    fn load(from: &[Lanes<N>]) -> Self {
        Self { series: std::array::from_fn(|k| from[k]) }
    }

    fn store(&self, to: &mut [Lanes<N>]) {
        to[..self.series.len()].copy_from_slice(&self.series);
    }
}

/// A struct of parameters that closures of a kind have, and the functions for packets of its lobes.
macro_rules! parameters {
    ($(#[$about:meta])* $kind:ident { $($(#[$field_about:meta])* $field:ident: $type:ident,)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug)]
        pub struct $kind<const N: usize = 1> {
            $($(#[$field_about])* pub $field: $type<N>,)*
        }

        const _: () = {
            use $crate::math::lanes::{LANES, Lanes, Lanes3};
            use $crate::scene::closure::lobes::{Lobes, OfPackets};
            use $crate::scene::closure::parameter::Parameter;
            use $crate::scene::closure::{Closure, Closures, Deltas, Evals, Kind, Lobe, Numbers, PARAMETERS, Proposals};

            impl<const N: usize> $kind<N> {
                /// The parameters of closures, as far as these are of the kind.
                #[inline(always)]
                pub(super) fn load(closures: &Closures<N>) -> Self {
                    let left = &closures.parameters[..];
                    $(
                        let $field = <$type<N> as Parameter<N>>::load(left);
                        let left = &left[<$type<N> as Parameter<N>>::SLOTS..];
                    )*
                    let _ = left;
                    Self { $($field,)* }
                }
            }

            impl $kind {
                /// A closure with these parameters. `roughness`: the smallest one of its smooth lobes, infinite for
                /// diffuse ones; `None` without smooth lobes.
                pub fn closure(&self, roughness: Option<f32>) -> Closure {
                    let (mut parameters, mut count) = ([Lanes::ZERO; PARAMETERS], 0);
                    $(
                        Parameter::store(&self.$field, &mut parameters[count..]);
                        count += <$type<1> as Parameter<1>>::SLOTS;
                    )*
                    Closure::new(Kind::$kind, &parameters[..count], roughness)
                }
            }

            impl OfPackets for $kind<LANES> {
                fn eval_packet(closures: &Closures, directions: [Lanes3; 2]) -> Evals {
                    eval(closures, directions)
                }

                fn propose_packet(closures: &Closures, wi: Lanes3, numbers: &Numbers) -> Proposals {
                    propose(closures, wi, numbers)
                }

                fn delta_packet(closures: &Closures, wi: Lanes3, lobe: Lobe) -> Deltas {
                    delta(closures, wi, lobe)
                }
            }

            vectorized! {
                fn eval(closures: &Closures, [wi, wo]: [Lanes3; 2]) -> Evals {
                    $kind::load(closures).eval(wi, wo)
                }
            }

            vectorized! {
                fn propose(closures: &Closures, wi: Lanes3, numbers: &Numbers) -> Proposals {
                    $kind::load(closures).propose(wi, numbers)
                }
            }

            vectorized! {
                fn delta(closures: &Closures, wi: Lanes3, lobe: Lobe) -> Deltas {
                    $kind::load(closures).delta(wi, lobe)
                }
            }
        };
    };
}
pub(super) use parameters;
