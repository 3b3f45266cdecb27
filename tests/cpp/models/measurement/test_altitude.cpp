// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "locfuse/models/measurement/altitude.hpp"
#include "support/expect.hpp"

namespace locfuse::test_altitude {
namespace {

TEST(AltitudeModel, is_the_height_of_the_altimeter) {
  const AltitudeModel model({0.25});
  EXPECT_EQ(model.predict(3.0), 3.25);
  const auto lin = model.linearize(3.0, {0, 3.5, 0.2});
  EXPECT_EQ(lin.residual(0), 0.25);
  EXPECT_EQ(lin.jacobian(0), 1.0);
  EXPECT_NEAR(lin.noise(0), 0.04, 1e-17);
  EXPECT_NEAR(AltitudeModel({0.25, 0.3}).linearize(3.0, {0, 3.5, {}}).noise(0), 0.09, 1e-17);
}

TEST(AltitudeModel, rejects_a_mount_that_is_not_finite) {
  testing::expect_refused([] { AltitudeModel({std::numeric_limits<double>::infinity()}); },
                          "altimeter_up_m");
  testing::expect_refused([] { AltitudeModel({0.0, 0.0}); }, "altitude.sigma_m");
}

}  // namespace
}  // namespace locfuse::test_altitude
