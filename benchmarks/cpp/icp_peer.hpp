// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Registers scan_room's scans to its surface points by PCL's ICP; named pcl_ICP.
void register_icp_peer();
