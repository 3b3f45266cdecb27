// SPDX-License-Identifier: Apache-2.0
// update() for the shapes of a pose with height, and of an inertial body.
#include "locfuse/filters/kalman.hpp"

namespace locfuse {

template Outcome update(GaussianBelief&, const Linearization<1, 4>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<1, 1>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 4, 3>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<1, 15>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 15, 3>&, Slots,
                        const Gate&);

}  // namespace locfuse
