// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/tag_order.hpp"

#include <algorithm>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "locfuse/geometry/rigid_fit.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {
namespace {

std::string joined(const std::array<Id, 3>& ids) {
  return std::to_string(ids[0]) + ", " + std::to_string(ids[1]) + ", " + std::to_string(ids[2]);
}

void check(const Tags& tags, const std::vector<PositionFix>& fixes) {
  if (tags.all().size() != 3 || fixes.size() != 3) {
    throw std::invalid_argument("an epoch of three tags has " + std::to_string(tags.all().size()) +
                                " tags and " + std::to_string(fixes.size()) +
                                " fixes, expected 3 of each");
  }
  for (std::size_t i = 0; i < 3; ++i) {
    validate(fixes[i]);
    if (reported_noise<2>(fixes[i].covariance, Vector<2>::Zero(), Vector<2>::Zero()).rows < 2) {
      throw std::invalid_argument("a fix of an epoch reports no covariance of both axes");
    }
    if (!fixes[i].tag || tags.find(*fixes[i].tag) == nullptr) {
      throw std::invalid_argument(
          "a fix of an epoch is of " +
          (fixes[i].tag ? "tag " + std::to_string(*fixes[i].tag) : std::string("no tag")) +
          ", expected one of " + joined({tags.all()[0].id, tags.all()[1].id, tags.all()[2].id}));
    }
    if (fixes[i].stamp != fixes[0].stamp) {
      throw std::invalid_argument("fixes of one epoch have stamps " +
                                  std::to_string(fixes[0].stamp) + " and " +
                                  std::to_string(fixes[i].stamp) + " ns, expected one stamp");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (fixes[j].tag == fixes[i].tag) {
        throw std::invalid_argument("an epoch has two fixes of tag " +
                                    std::to_string(*fixes[i].tag));
      }
    }
  }
}

}  // namespace

TagOrder tag_order(const std::vector<Tag>& tags, const std::vector<PositionFix>& fixes,
                   double probability) {
  const Tags known(tags);
  check(known, fixes);
  TagOrder order;
  Matrix<2, 3> world;
  Matrix<6, 6> covariance = Matrix<6, 6>::Zero();
  for (int i = 0; i < 3; ++i) {
    const PositionFix& z = fixes[static_cast<std::size_t>(i)];
    order.given[static_cast<std::size_t>(i)] = *z.tag;
    world.col(i) = z.position;
    covariance.block<2, 2>(2 * i, 2 * i) = z.covariance;
  }
  const auto misfit = [&](const std::array<Id, 3>& ids) {
    Matrix<2, 3> body;
    for (int i = 0; i < 3; ++i) {
      body.col(i) = known.find(ids[static_cast<std::size_t>(i)])->position.head<2>();
    }
    const RigidFit fit = rigid_fit(body, world, covariance);
    return fit.status == RigidFitStatus::kFitted || fit.status == RigidFitStatus::kMirrored
               ? fit.nis
               : std::numeric_limits<double>::infinity();
  };
  order.limit = chi_squared_quantile(3, probability);
  order.nis = misfit(order.given);
  order.ids = order.given;
  order.best = order.nis;
  if (order.nis <= order.limit) {
    order.verdict = TagOrderVerdict::kFits;
    return order;
  }
  std::array<Id, 3> ids = order.given;
  std::sort(ids.begin(), ids.end());
  int fitting = 0;
  do {
    const double nis = misfit(ids);
    fitting += nis <= order.limit ? 1 : 0;
    if (nis < order.best) {
      order.best = nis;
      order.ids = ids;
    }
  } while (std::next_permutation(ids.begin(), ids.end()));
  order.verdict = fitting == 0   ? TagOrderVerdict::kNoFit
                  : fitting == 1 ? TagOrderVerdict::kSwapped
                                 : TagOrderVerdict::kAmbiguous;
  return order;
}

std::string to_string(const TagOrder& order) {
  std::ostringstream text;
  text << "fixes of tags " << joined(order.given);
  if (order.verdict == TagOrderVerdict::kFits) {
    text << " fit their triangle (NIS " << order.nis << ", limit " << order.limit << ")";
    return text.str();
  }
  text << " do not fit their triangle (NIS " << order.nis << ", limit " << order.limit << ")";
  switch (order.verdict) {
    case TagOrderVerdict::kSwapped:
      text << ", but do as tags " << joined(order.ids) << " (NIS " << order.best
           << "): are ids swapped?";
      break;
    case TagOrderVerdict::kAmbiguous:
      text << ", but do in several other orders, best as tags " << joined(order.ids) << " (NIS "
           << order.best << "): are ids swapped?";
      break;
    default:
      text << ", nor in any other order (best NIS " << order.best
           << "): a fix is wrong, or the tags sit elsewhere on the body";
  }
  return text.str();
}

}  // namespace locfuse
