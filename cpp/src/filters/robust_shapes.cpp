// SPDX-License-Identifier: Apache-2.0
// The shapes that robust.hpp names as compiled here.
#include "locfuse/filters/robust.hpp"

namespace locfuse {

template Outcome update(GaussianBelief&, const Linearization<1, 3>&, Slots, const Gate&,
                        const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 2>&, Slots,
                        const Gate&, const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 3>&, Slots,
                        const Gate&, const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<1, 4>&, Slots, const Gate&,
                        const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<1, 15>&, Slots, const Gate&,
                        const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 15, 3>&, Slots,
                        const Gate&, const NoiseShape&);
template Outcome update(GaussianBelief&, const Linearization<1, Eigen::Dynamic>&, Slots,
                        const Gate&, const NoiseShape&);

}  // namespace locfuse
