// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "locfuse/maps/distance_field.hpp"
#include "locfuse/maps/ray_caster.hpp"
#include "messages.hpp"

/// Arbitrary small maps: cells, distance fields and ray casting.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  Id width = 0;
  Id height = 0;
  code(io, width);
  code(io, height);
  double resolution = 0.0;
  code(io, resolution, 0.0, 1.0);
  double margin = 0.0;
  code(io, margin, 0.0, 2.0);
  if (margin > 32.0 * resolution) {
    return 0;  // valid, but large
  }
  Pose2 origin;
  code(io, origin, 30.0);
  bool unknown_stops = false;
  code(io, unknown_stops);
  constexpr Cell kCells[] = {Cell::kFree, Cell::kOccupied, Cell::kUnknown, Cell::kFree};
  std::vector<Cell> cells(static_cast<std::size_t>(std::max(0, width) * std::max(0, height)));
  for (std::size_t i = 0; i < cells.size(); i += 4) {
    std::uint8_t four = 0;
    code(io, four, 256);
    for (std::size_t k = i; k < std::min(i + 4, cells.size()); ++k, four >>= 2) {
      cells[k] = kCells[four & 3];
    }
  }
  std::shared_ptr<const OccupancyGrid> grid;
  if (!fuzz::returns([&] {
        grid = std::make_shared<const OccupancyGrid>(width, height, resolution, origin, cells);
      })) {
    return 0;
  }
  std::optional<DistanceField> field;
  fuzz::returns([&] { field.emplace(grid, margin, DistanceField::Extra::kNearestTargets); });
  if (field) {
    fuzz::returns([&] { DistanceField(grid, margin, DistanceField::Extra::kSurroundings); });
  }
  const RayCaster caster(grid, unknown_stops);
  while (!io.empty()) {
    Pose2 pose;
    code(io, pose, 60.0);
    double reach = 0.0;
    code(io, reach, 0.0, 100.0);
    fuzz::returns([&] {
      (void)grid->at(pose.position());
      (void)grid->contains(pose.position());
    });
    if (field) {
      fuzz::returns([&] {
        const DistanceField::Neighbour found = field->nearest(pose.position());
        fuzz::require(found.target >= 0 && found.target < field->targets(),
                      "the nearest target is occupied");
        fuzz::require(found.distance >= 0.0 && field->distance(pose.position()) >= 0.0,
                      "a distance is not negative");
      });
    }
    fuzz::returns([&] {
      const double range = caster.cast(pose.position(), pose.heading, reach);
      fuzz::require(range >= 0.0, "a range is not negative");
      fuzz::require(range <= reach || std::isinf(range), "a beam ends within the maximum range");
    });
    fuzz::returns([&] { (void)caster.scan(pose, -1.0, 0.5, 5, reach); });
  }
  return 0;
}
