// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Benchmark pcl_icp: registers the scans of scan_room to its surface points by PCL's ICP.
void register_icp_peer();
