// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/message.hpp"

/// Binding functions, one per topic; module.cpp calls them in order.
void bind_math(pybind11::module_& m);
void bind_geometry(pybind11::module_& m);
void bind_gyro_odometry(pybind11::module_& m);
void bind_messages(pybind11::module_& m);
void bind_maps(pybind11::module_& m);
void bind_scan_matching(pybind11::module_& m);
void bind_scan_odometry(pybind11::module_& m);
void bind_landmarks(pybind11::module_& m);
void bind_models(pybind11::module_& m);
void bind_multilateration(pybind11::module_& m);
void bind_filters(pybind11::module_& m);
void bind_estimators(pybind11::module_& m);
void bind_air_ekf(pybind11::module_& m);
void bind_health(pybind11::module_& m);
void bind_pose_watch(pybind11::module_& m);
void bind_initializer(pybind11::module_& m);
void bind_landmark_ekf(pybind11::module_& m);
void bind_recovering_ekf(pybind11::module_& m);
void bind_switching_mcl(pybind11::module_& m);
void bind_mcl(pybind11::module_& m);
void bind_tags(pybind11::module_& m);
void bind_message_log(pybind11::module_& m);
void bind_replay(pybind11::module_& m);
void bind_live(pybind11::module_& m);
void bind_odometry_timeline(pybind11::module_& m);
void bind_smoothing(pybind11::module_& m);
void bind_mapping(pybind11::module_& m);
void bind_text(pybind11::module_& m);

/// Linearization of any size, the type Python constructs and receives.
using AnyLinearization = locfuse::Linearization<Eigen::Dynamic, Eigen::Dynamic>;

template <int M, int N, int MaxM>
AnyLinearization any_size(const locfuse::Linearization<M, N, MaxM>& lin) {
  return {lin.residual, lin.jacobian, lin.noise};
}

namespace pybind11::detail {

/// Message by the type of the Python object, not by trying one kind after the other.
template <>
struct type_caster<locfuse::Message> : variant_caster<locfuse::Message> {
  bool load(handle source, bool convert) {
    return load_exact(source, std::make_index_sequence<std::variant_size_v<locfuse::Message>>()) ||
           variant_caster<locfuse::Message>::load(source, convert);
  }

 private:
  template <std::size_t... I>
  bool load_exact(handle source, std::index_sequence<I...> /*all*/) {
    static const PyObject* const types[] = {
        type::of<std::variant_alternative_t<I, locfuse::Message>>().ptr()...};
    const PyObject* given = reinterpret_cast<PyObject*>(Py_TYPE(source.ptr()));
    return (
        (given == types[I] && load_as<std::variant_alternative_t<I, locfuse::Message>>(source)) ||
        ...);
  }
  template <class M>
  bool load_as(handle source) {
    make_caster<M> message;
    if (!message.load(source, false)) {
      return false;
    }
    value = cast_op<const M&>(message);
    return true;
  }
};

}  // namespace pybind11::detail
