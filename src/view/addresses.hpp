// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Where other devices find this machine.
#pragma once
#include <string>
#include <vector>

namespace cairn {

struct NetworkAddress {
  std::string address;    // IPv4 or IPv6
  std::string interface;  // its name
};

/// Of the interfaces that are up, but the loopback; those of containers and virtual machines come last.
[[nodiscard]] std::vector<NetworkAddress> network_addresses();

}  // namespace cairn
