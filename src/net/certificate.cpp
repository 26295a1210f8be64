// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/certificate.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <optional>
#include <stdexcept>

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr long kDay = 24 * 3600;                            // seconds
constexpr long kValidity = 397 * kDay;                      // maximum validity accepted by browsers
constexpr long kRenewalMargin = 7 * kDay;                   // renewal margin before the end
constexpr std::size_t kMaxFileSize = std::size_t{1} << 16;  // maximum file size in bytes

template <class T, void (*free)(T*)>
struct Free {
  void operator()(T* pointer) const { free(pointer); }
};
using Key = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY, EVP_PKEY_free>>;
using X = std::unique_ptr<X509, Free<X509, X509_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Free<X509_EXTENSION, X509_EXTENSION_free>>;
using Bytes = std::unique_ptr<BIO, Free<BIO, BIO_free_all>>;

void require(bool condition) {
  if (!condition)
    throw std::runtime_error("OpenSSL cannot create a certificate; the page cannot be served to other devices");
}

Bytes bytes_of(const std::string& text) { return Bytes(BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))); }

std::string fingerprint_of(const X509& certificate) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  require(X509_digest(&certificate, EVP_sha256(), digest, &size) == 1);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += fmt::format("{}{:02X}", i > 0 ? ":" : "", digest[i]);
  return text;
}

void extend(X509& certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, &certificate, &certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  require(extension && X509_add_ext(&certificate, extension.get(), -1) == 1);
}

X self_signed(EVP_PKEY& key, const std::vector<std::string>& addresses) {
  X certificate(X509_new());
  require(certificate != nullptr);
  X509& x = *certificate;
  X509_set_version(&x, X509_VERSION_3);
  std::uint64_t serial = 0;
  require(RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof serial) == 1);
  ASN1_INTEGER_set_uint64(X509_get_serialNumber(&x), serial >> 1);
  X509_gmtime_adj(X509_getm_notBefore(&x), -kDay);  // tolerates clock differences
  X509_gmtime_adj(X509_getm_notAfter(&x), kValidity - kDay);
  require(X509_set_pubkey(&x, &key) == 1);
  X509_NAME* name = X509_get_subject_name(&x);
  const auto* words = reinterpret_cast<const unsigned char*>("Cairn on this network");
  require(X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, words, -1, -1, 0) == 1);
  require(X509_set_issuer_name(&x, name) == 1);
  std::string names = "DNS:localhost";
  for (const std::string& address : addresses) names += ",IP:" + address;
  extend(x, NID_subject_alt_name, names);
  extend(x, NID_basic_constraints, "critical,CA:FALSE");
  extend(x, NID_key_usage, "critical,digitalSignature");
  extend(x, NID_ext_key_usage, "serverAuth");
  require(X509_sign(&x, &key, EVP_sha256()) > 0);
  return certificate;
}

Certificate create_for(const std::vector<std::string>& addresses) {
  const Key key(EVP_EC_gen("P-256"));
  require(key != nullptr);
  const X certificate = self_signed(*key, addresses);
  const Bytes out(BIO_new(BIO_s_mem()));
  require(out && PEM_write_bio_PrivateKey(out.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) == 1 &&
          PEM_write_bio_X509(out.get(), certificate.get()) == 1);
  char* data = nullptr;
  const long size = BIO_get_mem_data(out.get(), &data);
  return {.pem = std::string(data, static_cast<std::size_t>(size)), .fingerprint = fingerprint_of(*certificate)};
}

/// Reads a file owned and readable only by this user; empty otherwise.
std::string read_private(const fs::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return {};
  struct stat status {};
  std::string text;
  if (fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == geteuid() &&
      (status.st_mode & 077) == 0) {
    text.resize(kMaxFileSize);
    const ssize_t size = read(descriptor, text.data(), text.size());
    text.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  }
  close(descriptor);
  return text;
}

/// The stored certificate, if valid for these addresses.
std::optional<Certificate> stored_for(const std::vector<std::string>& addresses, const fs::path& file) {
  const std::string pem = read_private(file);
  const Key key(PEM_read_bio_PrivateKey(bytes_of(pem).get(), nullptr, nullptr, nullptr));
  const X certificate(PEM_read_bio_X509(bytes_of(pem).get(), nullptr, nullptr, nullptr));
  if (!key || !certificate || X509_check_private_key(certificate.get(), key.get()) != 1) return std::nullopt;
  time_t renewal_time = time(nullptr) + kRenewalMargin;
  if (X509_cmp_time(X509_get0_notAfter(certificate.get()), &renewal_time) <= 0) return std::nullopt;
  for (const std::string& address : addresses)
    if (X509_check_ip_asc(certificate.get(), address.c_str(), 0) != 1) return std::nullopt;
  return Certificate{.pem = pem, .fingerprint = fingerprint_of(*certificate)};
}

/// Writes a file readable only by its owner from creation on. Returns false on failure.
bool store(const std::string& pem, const fs::path& file) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  std::string temporary = file.string() + ".XXXXXX";
  const int descriptor = mkostemp(temporary.data(), O_CLOEXEC);  // mode 0600
  if (descriptor < 0) return false;
  const bool is_written = write(descriptor, pem.data(), pem.size()) == static_cast<ssize_t>(pem.size());
  const bool is_stored = close(descriptor) == 0 && is_written && rename(temporary.c_str(), file.c_str()) == 0;
  if (!is_stored) unlink(temporary.c_str());
  return is_stored;
}

}  // namespace

Certificate certificate_for(const std::vector<std::string>& addresses, const fs::path& file) {
  if (auto stored = file.empty() ? std::nullopt : stored_for(addresses, file)) return *std::move(stored);
  Certificate created = create_for(addresses);
  if (!file.empty()) (void)store(created.pem, file);
  return created;
}

fs::path state_folder() {
  const auto from = [](const char* variable) -> fs::path {
    const char* value = std::getenv(variable);
    return value != nullptr && value[0] == '/' ? value : "";
  };
  if (const fs::path folder = from("XDG_STATE_HOME"); !folder.empty()) return folder / "cairn";
  if (const fs::path home = from("HOME"); !home.empty()) return home / ".local" / "state" / "cairn";
  return {};
}

}  // namespace cairn
