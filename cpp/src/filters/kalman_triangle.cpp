// SPDX-License-Identifier: Apache-2.0
// update() for the shapes of three tags with velocities.
#include "locfuse/filters/kalman.hpp"

namespace locfuse {

template Outcome update(GaussianBelief&, const Linearization<1, 12>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<3, 12>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<6, 12>&, Slots, const Gate&);
template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 12, 2>&, Slots,
                        const Gate&);

}  // namespace locfuse
