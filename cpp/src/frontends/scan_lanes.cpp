// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_lanes.hpp"

#include "math/lanes.hpp"

namespace locfuse::internal::LOCFUSE_LANES {

namespace {

static_assert(kBeamGroup % kLanes == 0);
constexpr float kFittedCells = 5.0F;  // of a wall line: its shortest run, as WallLineTuning has it

double sum_distances(const DistanceTable& table, const LaneBeams& beams, const LanePose& pose) {
  const Lanes right = all(static_cast<float>(table.width));
  const Lanes top = all(static_cast<float>(table.height));
  const Lanes far_right = all(static_cast<float>(table.far_width));
  const Lanes far_top = all(static_cast<float>(table.far_height));
  const float per_far = 1.0F / table.far_cells;
  Lanes total{};
  Indices lost{};
  for (int i = 0; i < beams.count; i += kLanes) {
    const Lanes bx = load(beams.x + i);
    const Lanes by = load(beams.y + i);
    const Lanes x = pose.c * bx - pose.s * by + pose.x;
    const Lanes y = pose.s * bx + pose.c * by + pose.y;
    const Indices near = (x >= 0.0F) & (x < right) & (y >= 0.0F) & (y < top);
    Indices cell = whole(y) * table.width + whole(x);
    const Indices off = near == 0;
    if (any(off)) {
      const Lanes column = (x + right) * per_far;
      const Lanes row = (y + top) * per_far;
      const Indices far = (column >= 0.0F) & (column < far_right) & (row >= 0.0F) & (row < far_top);
      lost |= off & (far == 0);
      const Indices far_cell =
          whole(row) * table.far_width + whole(column) + table.width * table.height;
      cell = near ? cell : (far & far_cell);
    }
    Lanes found;
    for (int l = 0; l < kLanes; ++l) {
      found[l] = table.cells[cell[l]];
    }
    total += found * load(beams.used + i);
  }
  return any(lost) ? -1.0 : sum(total);
}

void find_targets(const std::int32_t* nearest, int width, int height, const LaneBeams& beams,
                  const LanePose& pose, std::int32_t* targets) {
  const Lanes right = all(static_cast<float>(width - 1));
  const Lanes top = all(static_cast<float>(height - 1));
  for (int i = 0; i < beams.count; i += kLanes) {
    const Lanes bx = load(beams.x + i);
    const Lanes by = load(beams.y + i);
    const Lanes x = pose.c * bx - pose.s * by + pose.x;
    const Lanes y = pose.s * bx + pose.c * by + pose.y;
    const Indices column = whole(smaller(larger(x, Lanes{}), right));
    const Indices row = whole(smaller(larger(y, Lanes{}), top));
    const Indices cell = row * width + column;
    for (int l = 0; l < kLanes; ++l) {
      targets[i + l] = nearest[cell[l]];
    }
  }
}

template <bool kHard>
void accumulate(const LaneBeams& beams, const LanePose& pose, const LaneWalls& walls,
                const LaneWeights& weights, float* residuals, float* correlated_beams,
                LaneSums& sums) {
  const float per_kernel = 1.0F / weights.kernel_squared;
  const Lanes one = all(1.0F);
  Lanes xx{}, xy{}, xt{}, x{}, yy{}, yt{}, y{}, tt{}, t{}, w{};
  Lanes xe{}, ye{}, te{}, e{}, lever{}, matches{};
  for (int i = 0; i < beams.count; i += kLanes) {
    const Lanes end_x = load(beams.x + i);
    const Lanes end_y = load(beams.y + i);
    const Lanes rx = pose.c * end_x - pose.s * end_y;
    const Lanes ry = pose.s * end_x + pose.c * end_y;
    const Lanes bx = rx - weights.laser_x;
    const Lanes by = ry - weights.laser_y;
    const Lanes ex = rx + pose.x - load(walls.x + i);
    const Lanes ey = ry + pose.y - load(walls.y + i);
    Lanes nx = load(walls.nx + i);
    Lanes ny = load(walls.ny + i);
    // The normal of a wall without a line is along the beam.
    const Indices bare = nx * nx + ny * ny < 0.5F;
    if (any(bare)) {
      const Lanes back = 1.0F / square_root(bx * bx + by * by + 1e-6F);
      nx = bare ? -bx * back : nx;
      ny = bare ? -by * back : ny;
    }
    // Normals point to the laser.
    const Indices away = nx * bx + ny * by > 0.0F;
    nx = away ? -nx : nx;
    ny = away ? -ny : ny;
    const Lanes run = load(walls.run + i);
    const Indices wall =
        (ex * ex + ey * ey < weights.reach_squared) & (run > 0.0F) & (load(beams.used + i) > 0.0F);
    const Lanes residual = wall ? nx * ex + ny * ey - weights.offset : all(kFar);
    const Lanes correlated = larger(run * load(walls.per_spacing + i), one);
    store(residual, residuals + i);
    store(correlated, correlated_beams + i);
    const Lanes rounding =
        (kFittedCells / 12.0F) * (1.0F / kFittedCells - 1.0F / larger(run, all(kFittedCells)));
    const Lanes noise = (rounding + weights.map_variance) * correlated + weights.beam_variance;
    const Lanes ratio = residual * residual * per_kernel;
    const Indices counts = kHard ? wall & (ratio < 1.0F) : wall;
    const Lanes share = counts ? one : Lanes{};
    const Lanes damped = kHard ? noise : (1.0F + ratio) * (1.0F + ratio) * noise;
    const Lanes weight = share / damped;
    const Lanes turn = ny * rx - nx * ry;
    const Lanes wx = weight * nx;
    const Lanes wy = weight * ny;
    const Lanes wt = weight * turn;
    xx += wx * nx;
    xy += wx * ny;
    xt += wx * turn;
    x += wx;
    yy += wy * ny;
    yt += wy * turn;
    y += wy;
    tt += wt * turn;
    t += wt;
    w += weight;
    xe += wx * residual;
    ye += wy * residual;
    te += wt * residual;
    e += weight * residual;
    lever += weight * (rx * rx + ry * ry);
    matches += share;
  }
  sums = {sum(xx), sum(xy), sum(xt), sum(x),  sum(yy), sum(yt), sum(y),     sum(tt),
          sum(t),  sum(w),  sum(xe), sum(ye), sum(te), sum(e),  sum(lever), sum(matches)};
}

void accumulate_any(const LaneBeams& beams, const LanePose& pose, const LaneWalls& walls,
                    const LaneWeights& weights, float* residuals, float* correlated,
                    LaneSums& sums) {
  if (weights.hard) {
    accumulate<true>(beams, pose, walls, weights, residuals, correlated, sums);
  } else {
    accumulate<false>(beams, pose, walls, weights, residuals, correlated, sums);
  }
}

}  // namespace

ScanLanes scan_lanes() { return {sum_distances, find_targets, accumulate_any}; }

}  // namespace locfuse::internal::LOCFUSE_LANES
