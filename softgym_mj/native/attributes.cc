#include "attributes.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <mujoco/mjplugin.h>

namespace softgym_mj {
namespace {

constexpr size_t kMostQuoted = 60;  // [bytes] Longest quotation of an invalid value.

}  // namespace

bool AttributeReader::Numbers(const char* name, double* out, int n, double low, double high, bool whole) {
  const char* text = Text(name);
  if (!text) return false;
  double values[4];
  const char* cursor = text;
  bool good = true;
  for (int i = 0; i < n && good; ++i) {
    char* end;
    values[i] = std::strtod(cursor, &end);
    good = end != cursor && std::isfinite(values[i]) && values[i] >= low && values[i] <= high &&
           (!whole || values[i] == std::floor(values[i]));
    cursor = end;
  }
  while (good && *cursor) good = std::isspace(static_cast<unsigned char>(*cursor++));
  if (!good) {
    char valid[120];
    const char* kind = whole ? "whole number" : "number";
    if (n == 1) {
      std::snprintf(valid, sizeof(valid), "a %s in %g..%g", kind, low, high);
    } else {
      std::snprintf(valid, sizeof(valid), "%d %ss, each in %g..%g", n, kind, low, high);
    }
    Fail(name, text, valid);
    return false;
  }
  for (int i = 0; i < n; ++i) out[i] = values[i];
  return true;
}

bool AttributeReader::Numbers(const char* name, float* out, int n, double low, double high) {
  double values[4];
  if (!Numbers(name, values, n, low, high)) return false;
  for (int i = 0; i < n; ++i) out[i] = static_cast<float>(values[i]);
  return true;
}

bool AttributeReader::Numbers(const char* name, int* out, int n, double low, double high) {
  double values[4];
  if (!Numbers(name, values, n, low, high, true)) return false;
  for (int i = 0; i < n; ++i) out[i] = static_cast<int>(values[i]);
  return true;
}

void AttributeReader::Flag(const char* name, bool* out) {
  const char* text = Text(name);
  if (!text) return;
  const std::string value = text;
  if (value == "true" || value == "1") {
    *out = true;
  } else if (value == "false" || value == "0") {
    *out = false;
  } else {
    Fail(name, value, "true or false");
  }
}

void AttributeReader::Choice(const char* name, const std::vector<std::string>& names, int* out) {
  const char* text = Text(name);
  if (!text) return;
  std::string valid;
  for (size_t i = 0; i < names.size(); ++i) {
    if (names[i] == text) {
      *out = static_cast<int>(i);
      return;
    }
    valid += (i == 0 ? "" : i + 1 < names.size() ? ", " : " or ") + names[i];
  }
  Fail(name, text, valid);
}

const char* AttributeReader::Text(const char* name) const {
  const char* text = mj_getPluginConfig(m_, instance_, name);
  if (!text) return nullptr;
  for (const char* c = text; *c; ++c) {
    if (!std::isspace(static_cast<unsigned char>(*c))) return text;
  }
  return nullptr;
}

void AttributeReader::Fail(const char* name, const std::string& value, const std::string& valid) {
  if (!error_.empty()) return;
  // The valid values must fit into MuJoCo's message. UTF-8 characters are not cut.
  size_t size = std::min(value.size(), kMostQuoted);
  while (size < value.size() && (value[size] & 0xc0) == 0x80) --size;
  const std::string quoted = value.substr(0, size) + (size < value.size() ? "..." : "");
  error_ = std::string("attribute ") + name + "=\"" + quoted + "\" is not valid: expected " + valid + ".";
}

std::string RawAttributes(const mjModel* m, int instance) {
  const char* first = m->plugin_attr + m->plugin_attradr[instance];
  const bool last = instance + 1 == m->nplugin;
  const char* end = m->plugin_attr + (last ? m->npluginattr : m->plugin_attradr[instance + 1]);
  return std::string(first, end);
}

void Fail(const mjModel* m, int instance, const char* reason) {
  const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
  mju_error("%s, instance \"%s\": %s", mjp_getPluginAtSlot(m->plugin[instance])->name, name ? name : "", reason);
}

}  // namespace softgym_mj
