// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// C interface of Eclipse Cyclone DDS 0.10, as far as it is used: https://github.com/eclipse-cyclonedds/cyclonedds.
// Enumerations are passed as int. Messages are exchanged in serialized form (`serdata`).
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

struct dds_qos;
struct ddsi_serdata;
using dds_entity_t = std::int32_t;  // negative: error code

struct dds_type_meta_ser {
  unsigned char* data;
  std::uint32_t sz;
};
/// Type of a topic. `m_ops`: fields, as instructions of the serializer (dds_opcodes.h).
struct dds_topic_descriptor {
  std::uint32_t m_size, m_align;  // bytes, of the type in memory
  std::uint32_t m_flagset, m_nkeys;
  const char* m_typename;
  const void* m_keys;
  std::uint32_t m_nops;
  const std::uint32_t* m_ops;
  const char* m_meta;
  dds_type_meta_ser type_information, type_mapping;
  std::uint32_t restrict_data_representation;  // bits
};
struct dds_sample_info {
  int sample_state, view_state, instance_state;
  bool valid_data;
  std::int64_t source_timestamp;  // ns, clock of the publisher's computer
  std::uint64_t instance_handle, publication_handle;
  std::uint32_t disposed_generation_count, no_writers_generation_count;
  std::uint32_t sample_rank, generation_rank, absolute_generation_rank;
};
struct dds_guid {
  std::uint8_t v[16];
};
struct dds_builtintopic_endpoint {
  dds_guid key, participant_key;
  std::uint64_t participant_instance_handle;
  char *topic_name, *type_name;
  dds_qos* qos;
};
struct dds_log_data {
  std::uint32_t priority, domid;
  const char* file;
  std::uint32_t line;
  const char *function, *message;
  std::size_t size, hdrsize;  // bytes, of the message and of its prefix
};

dds_entity_t dds_create_participant(std::uint32_t domain, const dds_qos* qos, const void* listener);
dds_entity_t dds_create_topic(dds_entity_t participant, const dds_topic_descriptor* descriptor, const char* name,
                              const dds_qos* qos, const void* listener);
dds_entity_t dds_create_reader(dds_entity_t participant, dds_entity_t topic, const dds_qos* qos, const void* listener);
dds_entity_t dds_create_writer(dds_entity_t participant, dds_entity_t topic, const dds_qos* qos, const void* listener);
dds_entity_t dds_create_readcondition(dds_entity_t reader, std::uint32_t mask);
dds_entity_t dds_create_waitset(dds_entity_t participant);
std::int32_t dds_waitset_attach(dds_entity_t waitset, dds_entity_t entity, std::intptr_t value);
std::int32_t dds_waitset_wait(dds_entity_t waitset, std::intptr_t* values, std::size_t size, std::int64_t timeout_ns);
std::int32_t dds_delete(dds_entity_t entity);
std::int32_t dds_read(dds_entity_t reader, void** samples, dds_sample_info* infos, std::size_t size,
                      std::uint32_t count);
std::int32_t dds_return_loan(dds_entity_t reader, void** samples, std::int32_t size);
std::int32_t dds_takecdr(dds_entity_t reader, ddsi_serdata** samples, std::uint32_t size, dds_sample_info* infos,
                         std::uint32_t mask);
std::int32_t dds_write(dds_entity_t writer, const void* sample);
std::uint32_t ddsi_serdata_size(const ddsi_serdata* sample);
void ddsi_serdata_to_ser(const ddsi_serdata* sample, std::size_t offset, std::size_t size, void* bytes);
void ddsi_serdata_unref(ddsi_serdata* sample);
dds_qos* dds_create_qos();
void dds_delete_qos(dds_qos* qos);
void dds_qset_reliability(dds_qos* qos, int kind, std::int64_t max_blocking_ns);
void dds_qset_durability(dds_qos* qos, int kind);
void dds_qset_history(dds_qos* qos, int kind, std::int32_t depth);
bool dds_qget_reliability(const dds_qos* qos, int* kind, std::int64_t* max_blocking_ns);
bool dds_qget_durability(const dds_qos* qos, int* kind);
const char* dds_strretcode(std::int32_t code);
void dds_set_log_sink(void (*sink)(void*, const dds_log_data*), void* argument);
// Only version 0.10 has both functions: other versions have other structs.
std::int32_t dds_get_typeinfo(dds_entity_t entity, void** type_info);
bool dds_is_shared_memory_available(dds_entity_t entity);
}

namespace cairn::dds {

// Values of the library's enumerations and macros.
enum Reliability { kBestEffort, kReliable };
enum Durability { kVolatile, kTransientLocal };
enum History { kKeepLast };
enum State : std::uint32_t { kAlive = 16, kAnyState = 127 };
enum LogPriority : std::uint32_t { kFatal = 1, kError = 2 };
constexpr dds_entity_t kPublications = 0x7fff0003;  // built-in topic of all publications
constexpr std::uint32_t kRestrictsRepresentation = 1u << 7, kXcdr1 = 1;

// clang-format off
#define CAIRN_DDS(X) \
  X(dds_create_participant) X(dds_create_topic) X(dds_create_reader) X(dds_create_writer) X(dds_create_readcondition) \
  X(dds_create_waitset) X(dds_waitset_attach) X(dds_waitset_wait) X(dds_delete) X(dds_read) X(dds_return_loan) \
  X(dds_takecdr) X(dds_write) X(ddsi_serdata_size) X(ddsi_serdata_to_ser) X(ddsi_serdata_unref) X(dds_create_qos) \
  X(dds_delete_qos) X(dds_qset_reliability) X(dds_qset_durability) X(dds_qset_history) X(dds_qget_reliability) \
  X(dds_qget_durability) X(dds_strretcode) X(dds_set_log_sink) X(dds_get_typeinfo) X(dds_is_shared_memory_available)
// clang-format on

}  // namespace cairn::dds
