// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <variant>

#include "bindings.hpp"
#include "locfuse/frontends/locate.hpp"
#include "locfuse/frontends/range_batch.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::AnchorTable;
using locfuse::LocateOptions;
using locfuse::Multilateration;
using locfuse::PositionSolution;
using locfuse::PositionStatus;
using locfuse::RangeLossKind;
using locfuse::RangePosition;
using locfuse::RangeSolver;
using Sigma = std::variant<double, Column<double>>;
using Pair = std::pair<Eigen::VectorXd, Eigen::VectorXd>;

namespace {

/// A struct, because pybind11 converts a bare variant to a union of types.
struct AnyMultilateration {
  std::variant<Multilateration<2>, Multilateration<3>> in;
};

template <class T, std::size_t Size>
T choose(const char* what, const std::string& name,
         const std::array<std::pair<const char*, T>, Size>& choices) {
  std::string expected;
  for (const auto& [known, value] : choices) {
    if (name == known) {
      return value;
    }
    expected += (expected.empty() ? "'" : ", '") + std::string(known) + "'";
  }
  throw std::invalid_argument(std::string(what) + " is '" + name + "', expected one of " +
                              expected);
}

locfuse::RangeLoss loss_of(const std::string& name, std::optional<double> scale) {
  constexpr std::array<std::pair<const char*, RangeLossKind>, 4> kLosses = {
      {{"none", RangeLossKind::kNone},
       {"huber", RangeLossKind::kHuber},
       {"cauchy", RangeLossKind::kCauchy},
       {"one_sided", RangeLossKind::kOneSided}}};
  if (scale && !(*scale > 0.0 && *scale < std::numeric_limits<double>::infinity())) {
    throw std::invalid_argument("loss_scale is " + std::to_string(*scale) +
                                ", expected a positive number of sigmas");
  }
  return {choose("loss", name, kLosses), scale.value_or(0.0)};
}

RangeSolver solver_of(const std::string& name) {
  constexpr std::array<std::pair<const char*, RangeSolver>, 4> kSolvers = {
      {{"newton", RangeSolver::kNewton},
       {"srls", RangeSolver::kSquaredRange},
       {"srwls", RangeSolver::kWeightedSquaredRange},
       {"ceres", RangeSolver::kCeres}}};
  return choose("solver", name, kSolvers);
}

AnchorTable table_of(const Column<double>& anchors, std::optional<double> height) {
  if (anchors.ndim() != 2) {
    throw std::invalid_argument("anchors have " + std::to_string(anchors.ndim()) +
                                " dimensions, expected an array of shape (m, 2) or (m, 3)");
  }
  constexpr py::ssize_t kMaxRows = locfuse::kMaxRanges + 1;  // rejected by validate
  return {locfuse::RowsView(anchors.data(), std::min(anchors.shape(0), kMaxRows),
                            std::min<py::ssize_t>(anchors.shape(1), 4)),
          height};
}

Eigen::Map<const Eigen::VectorXd> view(const Column<double>& numbers) {
  return {numbers.data(), numbers.size()};
}

Eigen::VectorXd sigmas_of(const Sigma& sigma, int size) {
  if (const double* one = std::get_if<double>(&sigma)) {
    return Eigen::VectorXd::Constant(size, *one);
  }
  const auto& each = std::get<Column<double>>(sigma);
  expect_shape("sigma", each, size);
  return view(each);
}

AnyMultilateration make_solver(const Column<double>& anchors, const Sigma& sigma,
                               std::optional<double> height, const std::string& loss,
                               std::optional<double> loss_scale, double wrong_side_probability,
                               double false_alarm_probability) {
  const AnchorTable table = table_of(anchors, height);
  const Eigen::VectorXd sigmas = sigmas_of(sigma, table.size());
  const locfuse::RangeLoss range_loss = loss_of(loss, loss_scale);
  const locfuse::PositionRules rules{wrong_side_probability, false_alarm_probability};
  if (table.dimensions() == 3) {
    return {Multilateration<3>(table, sigmas, {range_loss, rules})};
  }
  return {Multilateration<2>(table, sigmas, {range_loss, rules})};
}

PositionSolution locate(const Column<double>& anchors, const Column<double>& ranges,
                        const Sigma& sigma, std::optional<double> height, const std::string& loss,
                        std::optional<double> loss_scale, const std::optional<Pair>& prior,
                        const std::optional<Pair>& box, const std::string& weights,
                        const std::string& ml, double wrong_side_probability,
                        double false_alarm_probability, int max_iterations) {
  using locfuse::RangeMl;
  constexpr std::array<std::pair<const char*, RangeMl>, 3> kFits = {
      {{"newton", RangeMl::kNewton}, {"ceres", RangeMl::kCeres}, {"both", RangeMl::kBoth}}};
  using Weights = locfuse::SquaredRangeWeights;
  constexpr std::array<std::pair<const char*, Weights>, 2> kWeights = {
      {{"equal", Weights::kEqual}, {"variance", Weights::kVariance}}};
  const AnchorTable table = table_of(anchors, height);
  const Eigen::VectorXd sigmas = sigmas_of(sigma, table.size());
  expect_shape("ranges", ranges, table.size());
  LocateOptions options;
  options.loss = loss_of(loss, loss_scale);
  options.rules = {wrong_side_probability, false_alarm_probability};
  options.weights = choose("weights", weights, kWeights);
  options.ml = choose("ml", ml, kFits);
  options.ceres.max_iterations = max_iterations;
  if (prior) {
    options.prior = {prior->first, prior->second};
  }
  if (box) {
    options.box = {box->first, box->second};
  }
  return locfuse::locate(table, view(ranges), sigmas, options);
}

/// Positions of many epochs, as arrays.
struct PositionBatch {
  py::array_t<double> position;
  py::array_t<double> covariance;
  py::array_t<double> cost;
  py::array_t<std::uint8_t> status;
};

template <int N>
PositionBatch run_batch(const Multilateration<N>& solver, RangeSolver method,
                        const std::optional<locfuse::RowsView>& anchors,
                        const Column<double>& ranges) {
  const py::ssize_t n = ranges.shape(0);
  PositionBatch batch{py::array_t<double>({n, py::ssize_t(N)}),
                      py::array_t<double>({n, py::ssize_t(N), py::ssize_t(N)}),
                      py::array_t<double>(n), py::array_t<std::uint8_t>(n)};
  static_assert(sizeof(PositionStatus) == 1);
  const locfuse::PositionRows<N> out{
      {batch.position.mutable_data(), n, N},
      {batch.covariance.mutable_data(), n, N * N},
      {batch.cost.mutable_data(), n},
      {reinterpret_cast<PositionStatus*>(batch.status.mutable_data()), n}};
  const locfuse::RowsView rows(ranges.data(), n, solver.layout().size);
  {
    const py::gil_scoped_release release;
    locfuse::locate_batch<N>(solver, method, anchors, rows, out);
  }
  return batch;
}

PositionBatch locate_batch(const Column<double>& anchors, const Column<double>& ranges,
                           const Sigma& sigma, std::optional<double> height,
                           const std::string& solver, const std::string& loss,
                           std::optional<double> loss_scale, double wrong_side_probability,
                           double false_alarm_probability) {
  const bool own = anchors.ndim() == 3;
  Column<double> first = anchors;
  if (own) {
    if (anchors.shape(0) == 0) {
      throw std::invalid_argument("anchors hold no epoch, expected as many as ranges");
    }
    first = Column<double>({anchors.shape(1), anchors.shape(2)}, anchors.data());
  }
  const AnyMultilateration any = make_solver(first, sigma, height, loss, loss_scale,
                                             wrong_side_probability, false_alarm_probability);
  const py::ssize_t epochs = own ? anchors.shape(0) : (ranges.ndim() > 0 ? ranges.shape(0) : 0);
  expect_shape("ranges", ranges, epochs, std::max<py::ssize_t>(first.shape(0), 1));
  const RangeSolver method = solver_of(solver);
  std::optional<locfuse::RowsView> own_anchors;
  if (own) {
    own_anchors.emplace(anchors.data(), anchors.shape(0) * anchors.shape(1), anchors.shape(2));
  }
  return std::visit(
      [&](const auto& chosen) { return run_batch(chosen, method, own_anchors, ranges); }, any.in);
}

template <int N>
void bind_position(py::module_& m, const char* name) {
  using Position = RangePosition<N>;
  py::class_<Position>(m, name, "Position of one epoch, returned by `Multilateration.solve`.")
      .def_readonly("status", &Position::status)
      .def_property_readonly(
          "position",
          [](const Position& p) {
            return p.has_position ? std::optional(p.position) : std::nullopt;
          },
          "Best fit [m], or None. Check `status` first.")
      .def_readonly("covariance", &Position::covariance, "First order [m^2].")
      .def_readonly("cost", &Position::cost, "Chi-square, or the sum of losses.");
}

void bind_solution(py::module_& m) {
  using locfuse::MlComparison;
  using locfuse::PositionHypothesis;
  using locfuse::RangeCulprit;
  using locfuse::SolverComparison;
  py::class_<PositionHypothesis>(m, "PositionHypothesis", "A position that fits the ranges.")
      .def_readonly("position", &PositionHypothesis::position, "Shape (d,) [m].")
      .def_readonly("cost", &PositionHypothesis::cost, "Chi-square, or the sum of losses.")
      .def_readonly("covariance", &PositionHypothesis::covariance,
                    "First order, shape (d, d) [m^2]; infinite if a direction is unobservable.")
      .def_readonly("weak_direction", &PositionHypothesis::weak_direction,
                    "Unit vector of the largest uncertainty.")
      .def_readonly("weak_sigma", &PositionHypothesis::weak_sigma, "Sigma along it [m].")
      .def("__repr__", [](const PositionHypothesis& h) {
        return "PositionHypothesis(position=" +
               py::cast<std::string>(py::str(py::cast(h.position))) +
               ", cost=" + std::to_string(h.cost) + ")";
      });
  py::class_<SolverComparison>(m, "SolverComparison",
                               "SR-LS compared to maximum likelihood on the same ranges.")
      .def_readonly("squared_range_position", &SolverComparison::squared_range_position, "[m]")
      .def_readonly("squared_range_covariance", &SolverComparison::squared_range_covariance,
                    "First-order covariance of SR-LS [m^2].")
      .def_readonly("difference", &SolverComparison::difference,
                    "Maximum likelihood minus SR-LS [m].")
      .def_readonly("statistic", &SolverComparison::statistic,
                    "Squared Mahalanobis norm of the difference under its predicted covariance.")
      .def_readonly("dof", &SolverComparison::dof, "0 if they cannot be compared.")
      .def_readonly("limit", &SolverComparison::limit, "Largest statistic of inlier ranges.")
      .def_property_readonly("agree", &SolverComparison::agree);
  py::class_<MlComparison>(m, "MlComparison",
                           "How far apart the two solvers of maximum likelihood end.")
      .def_readonly("ceres_position", &MlComparison::ceres_position,
                    "Minimum of Ceres nearest to the best of `hypotheses`, shape (d,) [m].")
      .def_readonly("ceres_covariance", &MlComparison::ceres_covariance,
                    "First order, at that minimum, shape (d, d) [m^2].")
      .def_readonly("ceres_cost", &MlComparison::ceres_cost)
      .def_readonly("distance", &MlComparison::distance, "Between the two [m].")
      .def_readonly("sigmas", &MlComparison::sigmas,
                    "The same in standard deviations of the covariance of the best hypothesis.");
  py::class_<RangeCulprit>(m, "RangeCulprit", "Range whose removal improves a bad fit most.")
      .def_readonly("index", &RangeCulprit::index, "Index of the range.")
      .def_readonly("statistic", &RangeCulprit::statistic,
                    "Decrease of the cost by its removal: chi-square of 1 dof.")
      .def_readonly("explains", &RangeCulprit::explains, "Whether the other ranges are consistent.")
      .def_readonly("without", &RangeCulprit::without, "Position from the others [m].");
  py::class_<locfuse::Dilution>(m, "Dilution",
                                "Dilution of precision: sigma of a position per sigma of ranges.")
      .def_readonly("position", &locfuse::Dilution::position)
      .def_readonly("horizontal", &locfuse::Dilution::horizontal)
      .def_readonly("vertical", &locfuse::Dilution::vertical);
  py::class_<PositionSolution>(m, "PositionSolution",
                               "Position and diagnostics from one set of ranges.")
      .def_readonly("status", &PositionSolution::status)
      .def_readonly("reason", &PositionSolution::reason, "The status in words; '' if unique.")
      .def_readonly("hypotheses", &PositionSolution::hypotheses, "All hypotheses, ordered by cost.")
      .def_property_readonly(
          "position",
          [](const PositionSolution& s) {
            return s.status == PositionStatus::kUnique ? std::optional(s.hypotheses[0].position)
                                                       : std::nullopt;
          },
          "The position (d,) [m], or None unless the status is UNIQUE.")
      .def_property_readonly(
          "covariance",
          [](const PositionSolution& s) {
            return s.status == PositionStatus::kUnique ? std::optional(s.hypotheses[0].covariance)
                                                       : std::nullopt;
          },
          "Its covariance (d, d) [m^2], or None unless the status is UNIQUE.")
      .def_readonly("residuals", &PositionSolution::residuals,
                    "Range minus distance from the best hypothesis, shape (m,) [m].")
      .def_property_readonly("fits", &PositionSolution::fits)
      .def_readonly("fit_limit", &PositionSolution::fit_limit, "Largest cost of inlier ranges.")
      .def_readonly("fit_dof", &PositionSolution::fit_dof)
      .def_readonly("comparison", &PositionSolution::comparison)
      .def_readonly("ml_comparison", &PositionSolution::ml_comparison,
                    "Newton against Ceres, with `ml` 'both' where each found a minimum; else None.")
      .def_readonly("culprit", &PositionSolution::culprit)
      .def_readonly("dop", &PositionSolution::dop)
      .def_readonly("iterations", &PositionSolution::iterations)
      .def_readonly("termination", &PositionSolution::termination, "Why the solver stopped.");
}

constexpr const char* kLocateDoc =
    R"(Position from ranges by SR-LS and maximum likelihood, with all hypotheses.

Parameters
----------
anchors : array, shape (m, 2) or (m, 3)
    Positions of the anchors [m]; (m, 3) with `height`.
ranges : array, shape (m,)
    One per anchor [m].
sigma : float or array, shape (m,)
    Standard deviation of the ranges [m].
height : float, optional
    Known height of the tag [m]; the position is then estimated in the plane.
loss : {'none', 'huber', 'cauchy', 'one_sided'}
    Loss of the residuals; 'one_sided' suits ranges that read long (NLOS).
loss_scale : float, optional
    Residual at which the loss departs from the square [sigmas]; by default 95 % efficient.
prior : (mean, sigma), optional
    Prior mean and sigma per axis [m]; an infinite sigma for none.
box : (low, high), optional
    Corners of a box that contains the position [m].
weights : {'equal', 'variance'}
    SR-LS or SR-WLS.
ml : {'newton', 'ceres', 'both'}
    Whose minimum and covariance of maximum likelihood are returned: our Newton steps' or Ceres'.
    'both' returns ours, and in `ml_comparison` how far from it Ceres ends.
max_iterations : int
    Maximum number of steps that Ceres takes.

Returns
-------
PositionSolution
    Derivation: docs/models/ranges.md.

Raises
------
ValueError
    On numbers that are not finite, ranges or sigmas that are not positive, wrong shapes.

Examples
--------
>>> import numpy as np, locfuse.core
>>> anchors = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
>>> ranges = np.hypot(*(anchors - [3.0, 4.0]).T)
>>> solution = locfuse.locate(anchors, ranges, sigma=0.1)
>>> solution.status.name, solution.position.round(6).tolist(), solution.comparison.agree
('UNIQUE', [3.0, 4.0], True)
>>> on_a_line = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]])
>>> ranges = np.hypot(*(on_a_line - [3.0, 4.0]).T)
>>> [h.position.round(6).tolist() for h in locfuse.locate(on_a_line, ranges).hypotheses]
[[3.0, 4.0], [3.0, -4.0]]
)";

constexpr const char* kBatchDoc =
    R"(Positions of many epochs of ranges.

Parameters
----------
anchors : array, shape (m, 2) or (m, 3), or (n, m, 2 or 3)
    Positions of the anchors [m], of all epochs or one set per epoch.
ranges : array, shape (n, m)
    One row per epoch [m]; NaN for an anchor without a range.
sigma : float or array, shape (m,)
    Standard deviation of the ranges [m].
height : float, optional
    Known height of the tag [m].
solver : {'newton', 'ceres', 'srls', 'srwls'}
    Maximum likelihood by our Newton steps or by Ceres, both from SR-LS, or SR-LS or SR-WLS alone.
loss, loss_scale
    As in `locate`.

Returns
-------
PositionBatch
    Rows of epochs without a position are NaN; `status` says why.

Raises
------
ValueError
    As `locate`, but an epoch with a range that is not positive has the status BAD_RANGE.

Examples
--------
>>> import numpy as np, locfuse.core
>>> anchors = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
>>> truth = np.array([[3.0, 4.0], [6.0, 1.0]])
>>> ranges = np.linalg.norm(truth[:, None] - anchors, axis=2)
>>> locfuse.locate_batch(anchors, ranges).position.round(6).tolist()
[[3.0, 4.0], [6.0, 1.0]]
)";

constexpr const char* kBoundDoc =
    R"(Cramer-Rao bound of a position from ranges at each point.

Parameters
----------
anchors : array, shape (m, 2) or (m, 3)
    Positions of the anchors [m].
points : array, shape (k, 2) or (k, 3)
    Possible positions of the tag [m].
sigma : float or array, shape (m,)
    Standard deviation of the ranges [m].
height : float, optional
    Known height of the tag [m].

Returns
-------
array, shape (k, d, d)
    Minimum covariance of any unbiased estimator [m^2]; infinite on the diagonal where the ranges
    do not determine a direction.

Examples
--------
>>> import numpy as np, locfuse.core
>>> anchors = np.array([[10.0, 0.0], [0.0, 10.0]])
>>> locfuse.core.cramer_rao(anchors, [[0.0, 0.0]], 0.1).round(6).tolist()
[[[0.01, 0.0], [0.0, 0.01]]]
)";

py::array_t<double> cramer_rao(const Column<double>& anchors, const Eigen::MatrixXd& points,
                               const Sigma& sigma, std::optional<double> height) {
  const AnchorTable table = table_of(anchors, height);
  const Eigen::VectorXd sigmas = sigmas_of(sigma, table.size());
  const std::vector<Eigen::MatrixXd> bounds = locfuse::cramer_rao(table, sigmas, points);
  const py::ssize_t d = table.dimensions();
  py::array_t<double> out({static_cast<py::ssize_t>(bounds.size()), d, d});
  double* to = out.mutable_data();
  for (const Eigen::MatrixXd& bound : bounds) {
    to = std::copy_n(bound.data(), d * d, to);
  }
  return out;
}

}  // namespace

void bind_multilateration(py::module_& m) {
  py::native_enum<PositionStatus>(m, "PositionStatus", "enum.IntEnum",
                                  "Result of range-only positioning.")
      .value("UNIQUE", PositionStatus::kUnique, "one position fits")
      .value("INCONSISTENT", PositionStatus::kInconsistent,
             "one fits best, but worse than the sigmas permit")
      .value("AMBIGUOUS", PositionStatus::kAmbiguous, "several positions fit")
      .value("UNDERDETERMINED", PositionStatus::kUnderdetermined,
             "the ranges do not determine the position")
      .value("EXCLUDED", PositionStatus::kExcluded, "all positions that fit are outside the box")
      .value("NOT_CONVERGED", PositionStatus::kNotConverged, "no minimum was reached")
      .value("BAD_RANGE", PositionStatus::kBadRange, "a range is zero, negative or infinite")
      .finalize();
  bind_position<2>(m, "RangePosition2");
  bind_position<3>(m, "RangePosition3");
  bind_solution(m);
  py::class_<PositionBatch>(m, "PositionBatch", "Positions of n epochs, as arrays.")
      .def_readonly("position", &PositionBatch::position, "Shape (n, d) [m].")
      .def_readonly("covariance", &PositionBatch::covariance, "Shape (n, d, d) [m^2].")
      .def_readonly("cost", &PositionBatch::cost, "Shape (n,).")
      .def_readonly("status", &PositionBatch::status, "Values of `PositionStatus`, shape (n,).");

  const locfuse::PositionRules rules;
  py::class_<AnyMultilateration>(
      m, "Multilateration",
      "Range-only positioning with a fixed set of anchors; parameters as in `locate`.")
      .def(py::init(&make_solver), py::arg("anchors"), py::arg("sigma") = 0.1, py::kw_only(),
           py::arg("height") = py::none(), py::arg("loss") = "none",
           py::arg("loss_scale") = py::none(),
           py::arg("wrong_side_probability") = rules.wrong_side_probability,
           py::arg("false_alarm_probability") = rules.false_alarm_probability)
      .def(
          "solve",
          [](const AnyMultilateration& any,
             const Column<double>& ranges) -> std::variant<RangePosition<2>, RangePosition<3>> {
            return std::visit(
                [&](const auto& solver) -> std::variant<RangePosition<2>, RangePosition<3>> {
                  expect_shape("ranges", ranges, solver.layout().size);
                  return solver.solve(view(ranges));
                },
                any.in);
          },
          py::arg("ranges"),
          "Position from one range per anchor [m]; NaN for an anchor without a range.");
  m.def("locate", &locate, py::arg("anchors"), py::arg("ranges"), py::arg("sigma") = 0.1,
        py::kw_only(), py::arg("height") = py::none(), py::arg("loss") = "none",
        py::arg("loss_scale") = py::none(), py::arg("prior") = py::none(),
        py::arg("box") = py::none(), py::arg("weights") = "equal", py::arg("ml") = "newton",
        py::arg("wrong_side_probability") = rules.wrong_side_probability,
        py::arg("false_alarm_probability") = rules.false_alarm_probability,
        py::arg("max_iterations") = locfuse::CeresOptions{}.max_iterations, kLocateDoc);
  m.def("locate_batch", &locate_batch, py::arg("anchors"), py::arg("ranges"),
        py::arg("sigma") = 0.1, py::kw_only(), py::arg("height") = py::none(),
        py::arg("solver") = "newton", py::arg("loss") = "none", py::arg("loss_scale") = py::none(),
        py::arg("wrong_side_probability") = rules.wrong_side_probability,
        py::arg("false_alarm_probability") = rules.false_alarm_probability, kBatchDoc);
  m.def("cramer_rao", &cramer_rao, py::arg("anchors"), py::arg("points"), py::arg("sigma") = 0.1,
        py::arg("height") = py::none(), kBoundDoc);
}
