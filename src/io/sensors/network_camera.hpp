// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Frames of a program that connects over a network: docs/inputs.md, "Frames over a network".
#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "cairn/io/source.hpp"

namespace cairn {

/// True for tcp:... and ws:...
[[nodiscard]] bool is_network_camera(std::string_view name);

/// Listens at `tcp:PORT`, `tcp:HOST:PORT`, `ws:PORT` or `ws:HOST:PORT` (PORT 0: any free port; without HOST: only for
/// this machine), and waits for the first client, whose hello has the cameras of the source. A second client is
/// refused, a client that breaks the protocol is dropped with a warning, and a disconnected client is waited for, as an
/// unplugged sensor. The stream ends after a client's {"end": true}. Throws std::runtime_error for another name, and
/// for an address that cannot be used. `tracking`: state for the answers to the client; may be null.
[[nodiscard]] std::unique_ptr<Source> open_network_camera(const std::string& name,
                                                          std::shared_ptr<const TrackingState> tracking);

}  // namespace cairn
