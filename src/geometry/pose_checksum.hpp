// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <boost/crc.hpp>
#include <string>

namespace cairn {

/// Checksum over all bits of numbers and poses (CRC-64, ECMA-182), as 16 hexadecimal digits.
class PoseChecksum {
 public:
  void add(double number) { sum_.process_bytes(&number, sizeof number); }
  void add(const Eigen::Isometry3d& pose) { sum_.process_bytes(pose.matrix().data(), 16 * sizeof(double)); }
  [[nodiscard]] std::string text() const;

 private:
  boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~0ull, ~0ull, true, true> sum_;
};

}  // namespace cairn
