// SPDX-License-Identifier: Apache-2.0
// update() for the shapes of ranges of one epoch, a landmark in the state, and run-time sizes.
#include "locfuse/filters/kalman.hpp"

namespace locfuse {

template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 32>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<1, Eigen::Dynamic>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, Eigen::Dynamic>&,
                        Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 5, 2>&, Slots,
                        const Gate&);

}  // namespace locfuse
