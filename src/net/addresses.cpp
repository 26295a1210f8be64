// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/addresses.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <memory>
#include <string_view>

namespace cairn {
namespace {

bool is_virtual(std::string_view interface) {
  constexpr std::string_view kVirtual[] = {"docker", "br-", "veth", "virbr", "vmnet", "vboxnet", "lxc", "cni"};
  return std::any_of(std::begin(kVirtual), std::end(kVirtual),
                     [&](std::string_view begin) { return interface.starts_with(begin); });
}

/// Text of an address; empty if other devices cannot use it directly, as for link-local addresses.
std::string address_of(const sockaddr* address) {
  char text[INET6_ADDRSTRLEN] = "";
  if (address->sa_family == AF_INET)
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(address)->sin_addr, text, sizeof text);
  else if (address->sa_family == AF_INET6)
    if (const auto* ip = &reinterpret_cast<const sockaddr_in6*>(address)->sin6_addr; !IN6_IS_ADDR_LINKLOCAL(ip))
      inet_ntop(AF_INET6, ip, text, sizeof text);
  return text;
}

}  // namespace

std::vector<NetworkAddress> network_addresses() {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return {};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> hold(all, freeifaddrs);
  std::vector<NetworkAddress> addresses;
  for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next)
    if (i->ifa_addr != nullptr && (i->ifa_flags & IFF_UP) != 0 && (i->ifa_flags & IFF_LOOPBACK) == 0)
      if (std::string address = address_of(i->ifa_addr); !address.empty())
        addresses.push_back({std::move(address), i->ifa_name});
  std::stable_sort(addresses.begin(), addresses.end(), [](const NetworkAddress& a, const NetworkAddress& b) {
    const auto key = [](const NetworkAddress& n) {
      return 2 * static_cast<int>(is_virtual(n.interface)) + static_cast<int>(n.address.find(':') != std::string::npos);
    };
    return key(a) < key(b);
  });
  return addresses;
}

bool is_loopback(const std::string& host) {
  if (host.empty() || host == "localhost") return true;
  in_addr v4{};
  in6_addr v6{};
  constexpr std::uint32_t kLoopback = 127;
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 24 == kLoopback;
  return inet_pton(AF_INET6, host.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

}  // namespace cairn
