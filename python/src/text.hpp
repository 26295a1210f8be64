// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Text of objects: Name(field=value, ...).
#pragma once
#include <pybind11/pybind11.h>

#include <initializer_list>
#include <string>
#include <utility>

namespace cairn::python {

namespace py = pybind11;

struct Shown {
  template <class T>
  Shown(const char* field_name, T&& field_value) : name(field_name), value(py::cast(std::forward<T>(field_value))) {}
  const char* name;
  py::object value;
};

[[nodiscard]] inline std::string repr(const char* name, std::initializer_list<Shown> fields) {
  std::string text = std::string(name) + "(";
  for (const Shown& field : fields)
    text += (text.back() == '(' ? "" : ", ") + std::string(field.name) + "=" + std::string(py::repr(field.value));
  return text + ")";
}

}  // namespace cairn::python
