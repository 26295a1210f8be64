// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Self-signed TLS certificate for access from other devices; the only user of OpenSSL.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct Certificate {
  std::string pem;          // private key and certificate
  std::string fingerprint;  // SHA-256, in the notation of browsers
};

/// Certificate for these IP addresses and `localhost`. Returns the certificate in `file` if it is valid for them and
/// not about to expire, else a new certificate, stored there readable only by its owner, so that a phone asks for trust
/// only once. If `file` is empty or not writable, the new certificate is not stored.
[[nodiscard]] Certificate certificate_for(const std::vector<std::string>& addresses, const std::filesystem::path& file);

/// Folder for persistent program state by the XDG base directories; empty if there is none.
[[nodiscard]] std::filesystem::path state_folder();

}  // namespace cairn
