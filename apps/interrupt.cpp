// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "interrupt.hpp"

#include <unistd.h>

#include <csignal>
#include <cstring>
#include <initializer_list>
#include <utility>

namespace cairn::apps {
namespace {

constexpr int kInterrupted = 130;  // as shells tell it
volatile std::sig_atomic_t requests = 0;
const char* saying = "";

void say() { [[maybe_unused]] const auto written = write(STDERR_FILENO, saying, std::strlen(saying)); }

void on_signal(int) {
  requests = requests + 1;
  if (requests > 1) _exit(kInterrupted);
  say();
}

void on_last_signal(int) {
  say();
  _exit(kInterrupted);
}

void handle(void (*handler)(int)) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, handler);
}

}  // namespace

Interrupt::Interrupt(const char* said) {
  requests = 0;
  saying = said;
  handle(on_signal);
}

Interrupt::~Interrupt() { handle(SIG_DFL); }

bool Interrupt::requested() const { return requests > 0; }

EndAtOnce::EndAtOnce(std::string said) : said_(std::move(said)) {
  saying = said_.c_str();
  handle(on_last_signal);
}

EndAtOnce::~EndAtOnce() { handle(SIG_DFL); }

}  // namespace cairn::apps
