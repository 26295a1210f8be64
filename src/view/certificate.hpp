// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A certificate that a machine gives itself, so that other devices reach it over TLS; a door to OpenSSL.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct Certificate {
  std::string pem;          // its private key, and itself
  std::string fingerprint;  // SHA-256, as browsers show it
};

/// For these IP addresses, and `localhost`: the one in `file`, if it is good for them for a while, else a new one,
/// which is kept there for the next time, readable by its owner alone. A phone that was told to trust it need not be
/// told again. `file` may be empty, and it need not be writable: then it is for this time.
[[nodiscard]] Certificate certificate_for(const std::vector<std::string>& addresses, const std::filesystem::path& file);

/// Where programs keep such things for their user, by the XDG base directories; empty where there is no such place.
[[nodiscard]] std::filesystem::path state_folder();

}  // namespace cairn
