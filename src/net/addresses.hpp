// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Network addresses of this machine.
#pragma once
#include <string>
#include <vector>

namespace cairn {

struct NetworkAddress {
  std::string address;    // IPv4 or IPv6
  std::string interface;  // interface name
};

/// Addresses of all active interfaces except loopback; containers and virtual machines come last.
[[nodiscard]] std::vector<NetworkAddress> network_addresses();

/// True if only this machine reaches a server at `host`: empty, localhost, 127.0.0.0/8 or ::1.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace cairn
