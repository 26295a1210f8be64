// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/browser.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kPollInterval = 100ms;
constexpr auto kLoadTimeout = 15s;  // limit for a browser to start and to load the page

/// Returns true if only this user can access the folder.
bool is_private(const fs::path& folder) {
  struct stat status {};
  return folder.is_absolute() && lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         status.st_uid == geteuid() && (status.st_mode & (S_IRWXG | S_IRWXO)) == 0;
}

/// Returns $XDG_RUNTIME_DIR if it is private, else the system's temporary folder.
fs::path private_folder() {
  const char* given = std::getenv("XDG_RUNTIME_DIR");
  if (given != nullptr && is_private(given)) return given;
  return fs::temp_directory_path();
}

std::string as_file_url(const fs::path& file) {
  std::string url = "file://";
  for (const char c : file.string())
    url += std::isalnum(static_cast<unsigned char>(c)) != 0 || std::strchr("-._~/", c) != nullptr
               ? std::string(1, c)
               : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return url;
}

/// HTML page that redirects to `url` without a referrer and without an entry in the history.
std::string redirect_to(const std::string& url) {
  return fmt::format(
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">"
      "<meta http-equiv=\"refresh\" content=\"0; url={0}\"><title>Cairn</title>"
      "<p><a href=\"{0}\">Open the map</a></p></html>\n",
      url);
}

/// Writes a new file that only this user can read.
void write_private(const fs::path& file, const std::string& text) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR);
  const bool is_written = descriptor >= 0 && write(descriptor, text.data(), text.size()) == std::ssize(text);
  const int error = errno;
  if (descriptor >= 0) close(descriptor);
  if (!is_written) throw std::runtime_error(file.string() + ": cannot be written: " + std::strerror(error));
}

/// Commands of $BROWSER, a colon-separated list. `%s` is replaced by the address; without `%s` the address is appended.
std::vector<std::vector<std::string>> browser_commands(const std::string& url) {
  std::vector<std::vector<std::string>> all;
  const char* given = std::getenv("BROWSER");
  std::istringstream list(given != nullptr ? given : "");
  for (std::string entry; std::getline(list, entry, ':');) {
    std::vector<std::string> arguments;
    std::istringstream line(entry);
    bool has_placeholder = false;
    for (std::string argument; line >> argument;) {
      const auto at = argument.find("%s");
      if (at != argument.npos) argument.replace(at, 2, url);
      has_placeholder = has_placeholder || at != argument.npos;
      arguments.push_back(argument);
    }
    if (arguments.empty()) continue;
    if (!has_placeholder) arguments.push_back(url);
    all.push_back(std::move(arguments));
  }
  all.push_back({"xdg-open", url});
  return all;
}

/// Starts a process detached from the terminal. Returns 0 if the program does not exist.
pid_t start(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, descriptor, "/dev/null", O_RDWR, 0);
  posix_spawnattr_t attributes;  // own process group, so that Ctrl-C reaches only Cairn
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t process = 0;
  const int error = posix_spawnp(&process, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? process : 0;
}

bool succeeds(pid_t process) {
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR) return true;  // status unknown
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

namespace {

void open_browser(const std::string& url) {
  std::thread([all = browser_commands(url)] {
    for (const auto& arguments : all)
      if (const pid_t process = start(arguments); process != 0 && succeeds(process)) return;
    fmt::print(stderr, "no browser could be opened: open the address yourself, or name one in BROWSER\n");
  }).detach();
}

}  // namespace

BrowserPage::BrowserPage(const std::string& url, std::function<bool()> is_loaded) {
  try {
    std::string folder = (private_folder() / "cairn-open-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr)
      throw std::runtime_error(folder + ": cannot be created: " + std::strerror(errno));
    folder_ = folder;
    const fs::path file = folder_ / "open.html";
    write_private(file, redirect_to(url));
    open_browser(as_file_url(file));
  } catch (const std::exception& error) {
    fmt::print(stderr, "no browser is opened: {}; open the address yourself\n", error.what());
    remove();
    return;
  }
  watch_ = std::jthread([this, is_loaded = std::move(is_loaded)](const std::stop_token& stop) {
    const auto begin = std::chrono::steady_clock::now();
    for (bool is_reported = false; !stop.stop_requested() && !is_loaded(); std::this_thread::sleep_for(kPollInterval)) {
      if (is_reported || std::chrono::steady_clock::now() - begin < kLoadTimeout) continue;
      is_reported = true;
      fmt::print(stderr,
                 "the browser has not loaded the page: open the address yourself (a browser from a Snap or Flatpak may "
                 "be unable to read {})\n",
                 folder_.string());
    }
    remove();
  });
}

BrowserPage::~BrowserPage() = default;

void BrowserPage::remove() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove(folder_ / "open.html", ignored), fs::remove(folder_, ignored);
}

}  // namespace cairn::apps
