// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Addresses of the web server of a viewer.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

inline constexpr int kDefaultViewerPort = 4242;

/// Network address of a viewer.
struct ViewerAddress {
  int port = kDefaultViewerPort;  ///< 0: any free port
  /// Empty: accessible from this machine only, at http://127.0.0.1:PORT/TOKEN/. An IP address of this machine: also
  /// accessible to devices of that network with the token, at https://HOST:PORT/TOKEN/; 0.0.0.0: on all its networks.
  /// The certificate is self-signed, so a browser asks once for trust.
  std::string host;
  std::filesystem::path certificates;  ///< folder of the certificate; empty: the user's state folder
};

/// URLs of a running viewer.
struct ViewerSite {
  struct Url {
    std::string url, interface;  ///< interface: name of the network interface
  };
  std::vector<Url> urls;    ///< at least one, most likely first
  std::string fingerprint;  ///< SHA-256 of the certificate, in the format of browsers; empty: HTTP
};

}  // namespace cairn
