#include "cloth/plugin/workspace.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <unordered_map>
#include <utility>

#include <mujoco/mjplugin.h>

#include "native/attributes.h"
#include "native/flex.h"
#include "native/limits.h"

namespace softgym_mj::cloth {
namespace {

constexpr size_t kMostFlexes = 4096;  // Limit of the table of pairs of flexes.

// Workspace of each mjData. It is not in plugin_data because bytewise copies of an mjData, such as pickles, would copy
// the pointer.
class Workspaces {
 public:
  Workspace* Find(const mjData* d) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = of_.find(d);
    return found == of_.end() ? nullptr : found->second.get();
  }
  void Set(const mjData* d, std::unique_ptr<Workspace> workspace) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (workspace) {
      of_[d] = std::move(workspace);
    } else {
      of_.erase(d);
    }
  }

 private:
  std::mutex mutex_;
  std::unordered_map<const mjData*, std::unique_ptr<Workspace>> of_;
};

Workspaces& All() {
  static Workspaces* workspaces = new Workspaces;  // Never destroyed, because mjData may outlive static objects.
  return *workspaces;
}

std::string FlexName(const mjModel* m, int flex) {
  const char* name = mj_id2name(m, mjOBJ_FLEX, flex);
  return "flex " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(flex));
}

// Returns the instance of this plugin that carries a flex, or -1.
int InstanceOf(const mjModel* m, int flex, int slot) {
  for (int v = m->flex_vertadr[flex]; v < m->flex_vertadr[flex] + m->flex_vertnum[flex]; ++v) {
    const int instance = m->body_plugin[m->flex_vertbodyid[v]];
    if (instance >= 0 && m->plugin[instance] == slot) return instance;
  }
  return -1;
}

// Whether a vertex has its own body with restricted motion, as in a flexcomp with dof="2d" or "radial".
bool IsOnRails(const mjModel* m, int body) {
  const int joint = m->body_jntadr[body], count = m->body_jntnum[body];
  const auto slides = [](int type) { return type == mjJNT_SLIDE; };
  return count > 0 && !OnSlides(m, body) && std::all_of(m->jnt_type + joint, m->jnt_type + joint + count, slides) &&
         m->body_geomnum[body] == 0 && m->body_subtreemass[body] == m->body_mass[body];
}

std::string CheckVertices(const mjModel* m, int f) {
  for (int v = 0; v < m->flex_vertnum[f]; ++v) {
    if (!IsOnRails(m, m->flex_vertbodyid[m->flex_vertadr[f] + v])) continue;
    return FlexName(m, f) + " cannot be handled: vertex " + std::to_string(v) +
           " slides along fewer than three axes at right angles: expected dof=\"full\", or a vertex of a body with a "
           "geom.";
  }
  return "";
}

std::string CheckFlex(const mjModel* m, int f) {
  if (m->flex_dim[f] > 2 || m->flex_interp[f] || m->flex_rigid[f]) {
    return FlexName(m, f) +
           " cannot be handled: expected a deformable one of dimension 1 or 2 with vertices, "
           "dof=\"full\".";
  }
  if (m->flex_selfcollide[f] != mjFLEXSELF_NONE || m->flex_contype[f] || m->flex_conaffinity[f]) {
    return FlexName(m, f) +
           " would collide twice: expected <contact selfcollide=\"none\" contype=\"0\" "
           "conaffinity=\"0\"/>.";
  }
  if (m->flex_edgeequality[f])
    return FlexName(m, f) + " would be stretched twice: expected <edge equality=\"false\"/>.";
  return "";
}

// A flex that twists must be one rope from end to end, or one ring.
std::string CheckTwist(const mjModel* m, const Mesh& mesh) {
  for (size_t p = 0; p < mesh.flexes.size(); ++p) {
    const auto belongs = [&](const Mesh::Chain& chain) { return mesh.part[chain.vertex[0]] == static_cast<int>(p); };
    if (mesh.materials[p].twist > 0 && std::count_if(mesh.chains.begin(), mesh.chains.end(), belongs) != 1) {
      return FlexName(m, mesh.flexes[p]) + " cannot twist: expected a rope without branches, or one ring.";
    }
  }
  return "";
}

std::string ParseMaterial(const mjModel* m, int instance, Material* out) {
  AttributeReader read(m, instance);
  read.Numbers("stretch", &out->stretch, 1, 1e-3, 1e6);
  read.Numbers("shear", &out->shear, 1, 1e-3, 1);
  read.Numbers("stiffening", &out->stiffening, 1, 0, 1000);
  read.Numbers("bend", &out->bend, 1, 0, 1);
  read.Numbers("bend_weft", &out->bend_weft, 1, 0, 1);
  read.Numbers("bend_bias", &out->bend_bias, 1, 0, 1);
  read.Numbers("stretch_damping", &out->stretch_damping, 1, 0, 1);
  read.Numbers("bend_damping", &out->bend_damping, 1, 0, 1);
  read.Numbers("friction", &out->friction, 1, 0, 10);
  read.Numbers("drag", &out->drag, 1, 0, 100);
  read.Numbers("added_mass", &out->added_mass, 1, 0, 100);
  read.Numbers("contype", &out->contype, 1, 0, 1 << 30);
  read.Numbers("conaffinity", &out->conaffinity, 1, 0, 1 << 30);
  read.Numbers("twist", &out->twist, 1, 0, 1);
  read.Numbers("twist_clamped", &out->twist_clamped, 1, 0, 1);
  return read.error();
}

std::string ParseSettings(const mjModel* m, int instance, Settings* out) {
  AttributeReader read(m, instance);
  read.Numbers("substeps", &out->substeps, 1, 1, 1000);
  read.Numbers("sweeps", &out->sweeps, 1, 1, 1000);
  read.Numbers("contact_stiffness", &out->contact_stiffness, 1, 1, 1e7);
  read.Numbers("contact_damping", &out->contact_damping, 1, 0, 1);
  return read.error();
}

Vertex FindVertex(const mjModel* m, int body) {
  if (!OnSlides(m, body)) return {body, -1, -1, false};
  return {body, m->body_dofadr[body], m->jnt_qposadr[m->body_jntadr[body]],
          m->body_treeid[m->body_parentid[body]] >= 0};
}

}  // namespace

bool Leads(const mjModel* m, int instance) {
  return std::find(m->plugin, m->plugin + instance, m->plugin[instance]) == m->plugin + instance;
}

bool Twists(const mjModel* m, int instance) {
  for (int other = 0; other < m->nplugin; ++other) {
    double twist = 0;
    if (m->plugin[other] == m->plugin[instance]) AttributeReader(m, other).Numbers("twist", &twist, 1, 0, 1);
    if (twist > 0) return true;
  }
  return false;
}

Workspace* FindWorkspace(const mjData* d) { return All().Find(d); }

Workspace* FindWorkspace(const mjModel* m, const mjData* d, int* found) {
  for (int instance = 0; instance < m->nplugin; ++instance) {
    *found = instance;
    const mjpPlugin* plugin = mjp_getPluginAtSlot(m->plugin[instance]);
    if (plugin && std::strcmp(plugin->name, kPluginName) == 0 && Leads(m, instance)) return FindWorkspace(d);
  }
  return nullptr;
}

void SetWorkspace(const mjData* d, std::unique_ptr<Workspace> workspace) { All().Set(d, std::move(workspace)); }

std::string Open(const mjModel* m, int instance, Workspace* w) {
  const std::string beyond = CheckLimits(m);
  if (!beyond.empty()) return beyond;
  w->flexes.clear();
  std::vector<Material> materials;
  for (int f = 0; f < m->nflex; ++f) {
    const int of_flex = InstanceOf(m, f, m->plugin[instance]);
    if (of_flex < 0) continue;
    std::string error = CheckFlex(m, f);
    materials.emplace_back();
    if (error.empty()) error = ParseMaterial(m, of_flex, &materials.back());
    if (!error.empty()) return error;
    w->flexes.push_back(f);
  }
  if (w->flexes.size() > kMostFlexes) {
    return std::to_string(w->flexes.size()) + " flexes carry it: expected at most " + std::to_string(kMostFlexes) + ".";
  }
  if (w->flexes.empty()) return "no flex carries it: expected <plugin instance=\"...\"/> inside a flexcomp.";
  if (m->opt.integrator == mjINT_RK4) {
    return "integrator RK4 is not supported: expected Euler, implicit, implicitfast or discrete.";
  }
  if (m->opt.enableflags & mjENBL_SLEEP) return "the flag sleep is not supported.";
  if ((m->opt.disableflags & mjDSBL_SPRING) && (m->opt.disableflags & mjDSBL_DAMPER)) {
    return "the plugin needs MuJoCo's passive forces, which the flags spring and damper disable: enable one of them.";
  }
  Settings settings;
  const std::string error = ParseSettings(m, instance, &settings);
  if (!error.empty()) return error;
  WriteSignature(m, w->flexes, &w->scratch);
  w->scratch.append(reinterpret_cast<const char*>(materials.data()), materials.size() * sizeof(Material));
  w->scratch.append(reinterpret_cast<const char*>(&settings), sizeof(settings));
  w->scratch.append(reinterpret_cast<const char*>(&m->opt.timestep), sizeof(mjtNum));
  WriteMeshes(m, materials, &w->scratch);
  if (w->scratch == w->signature) return "";
  w->signature.clear();  // Invalid until the workspace is complete.
  for (int f : w->flexes) {
    const std::string rails = CheckVertices(m, f);
    if (!rails.empty()) return rails;
  }
  w->mesh = MakeMesh(m, w->flexes, materials);
  const std::string branched = CheckTwist(m, w->mesh);
  if (!branched.empty()) return branched;
  w->solver.Reset(w->mesh, settings, m->opt.timestep);
  w->settings = settings;
  const std::string wrong = w->solids.Reset(m, materials);
  if (!wrong.empty()) return wrong;
  w->vertices.clear();
  for (int f : w->flexes) {
    const int* body = m->flex_vertbodyid + m->flex_vertadr[f];
    for (int i = 0; i < m->flex_vertnum[f]; ++i) w->vertices.push_back(FindVertex(m, body[i]));
  }
  w->signature = w->scratch;
  return "";
}

}  // namespace softgym_mj::cloth
