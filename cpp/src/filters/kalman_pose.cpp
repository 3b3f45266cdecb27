// SPDX-License-Identifier: Apache-2.0
// update() for the shapes of a pose.
#include "locfuse/filters/kalman.hpp"

namespace locfuse {

template Outcome update(GaussianBelief&, const Linearization<1, 3>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<2, 3>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 2>&, Slots,
                        const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 3>&, Slots,
                        const Gate&);

}  // namespace locfuse
