// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "interrupt.hpp"

#include <unistd.h>

#include <csignal>
#include <cstring>
#include <initializer_list>

namespace cairn::apps {
namespace {

constexpr int kInterrupted = 130;  // as shells tell it
volatile std::sig_atomic_t requests = 0;
const char* saying = "";

void on_signal(int) {
  requests = requests + 1;
  if (requests > 1) _exit(kInterrupted);
  [[maybe_unused]] const auto written = write(STDERR_FILENO, saying, std::strlen(saying));
}

}  // namespace

Interrupt::Interrupt(const char* said) {
  requests = 0;
  saying = said;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, on_signal);
}

Interrupt::~Interrupt() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
}

bool Interrupt::requested() const { return requests > 0; }

}  // namespace cairn::apps
