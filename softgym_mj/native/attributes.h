// Reads and checks the attributes of a plugin instance.

#ifndef SOFTGYM_MJ_NATIVE_ATTRIBUTES_H_
#define SOFTGYM_MJ_NATIVE_ATTRIBUTES_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

namespace softgym_mj {

// Every method keeps the default if the attribute is absent or blank, and stores the first error.
class AttributeReader {
 public:
  AttributeReader(const mjModel* m, int instance) : m_(m), instance_(instance) {}

  // First error as a sentence, or "".
  const std::string& error() const { return error_; }

  // Reads `n` <= 4 numbers in [low, high]. Returns true if they are present and valid.
  bool Numbers(const char* name, double* out, int n, double low, double high, bool whole = false);
  bool Numbers(const char* name, float* out, int n, double low, double high);
  bool Numbers(const char* name, int* out, int n, double low, double high);
  void Flag(const char* name, bool* out);
  // Reads the index of the value in `names`.
  void Choice(const char* name, const std::vector<std::string>& names, int* out);

 private:
  const char* Text(const char* name) const;  // nullptr if it is absent or blank.
  void Fail(const char* name, const std::string& value, const std::string& valid);

  const mjModel* m_;
  int instance_;
  std::string error_;
};

// Returns all attributes of an instance as MuJoCo stores them, to detect changes.
std::string RawAttributes(const mjModel* m, int instance);

// Stops the compilation of a model with an error that names the plugin and the instance. No object with a destructor
// may be alive, because MuJoCo's compiler leaves by longjmp.
void Fail(const mjModel* m, int instance, const char* reason);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_ATTRIBUTES_H_
