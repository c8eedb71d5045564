// Puts rows in levels without a common vertex, as `Levels` does: what comes out is the same.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

constexpr Key kNoKey = ~Key{0};

// A row's key: by the hash of its vertices, then by a number that no other with the same vertices has.
inline Key RowKey(const int* vertex, int corners, unsigned number) {
  return static_cast<Key>(RowHash(vertex, corners)) << 32 | number;
}

// Levels of the rows, of which `key` and `vertex` are filled in: each has the first one on which it shares no vertex
// that `counts` with a row of a lower key (Jones and Plassmann, 1993). Fills `order`, where rows of a level come in the
// order of their keys if they are `ranked`. Beyond the last level rows are left out.
template <class F>
inline void MakeLevels(const Environment& w, int corners, bool ranked, Rows* rows, F counts) {
  const int levels = rows->room, words = (levels + 63) / 64, count = rows->count;
  Each(w.model->padded, [&](int v) {
    for (int k = 0; k < words; ++k) w.taken[words * v + k] = 0;
  });
  Each(count, [&](int i) { rows->level[i] = -1; });
  Once([&] { w.step->remaining = count; });
  while (w.step->remaining > 0) {
    Each(w.model->padded, [&](int v) { w.best[v] = kNoKey; });
    Each(count, [&](int i) {
      for (int k = 0; rows->level[i] < 0 && k < corners; ++k) {
        const int v = rows->vertex[corners * i + k];
        if (counts(v)) TakeLeast(&w.best[v], rows->key[i]);
      }
    });
    Each(count, [&](int i) {
      if (rows->level[i] >= 0) return;
      const int* vertex = rows->vertex + corners * i;
      bool first = true;
      for (int k = 0; k < corners; ++k) first = first && (!counts(vertex[k]) || w.best[vertex[k]] == rows->key[i]);
      if (!first) return;
      int level = -1;
      for (int word = 0; word < words && level < 0; ++word) {
        Key taken = 0;
        for (int k = 0; k < corners; ++k) taken |= counts(vertex[k]) ? w.taken[words * vertex[k] + word] : 0;
        if (~taken == 0) continue;
        level = 64 * word + FirstBit(~taken);
        for (int k = 0; k < corners; ++k) {
          if (counts(vertex[k])) w.taken[words * vertex[k] + word] |= Key{1} << level % 64;
        }
      }
      if (level < 0 || level >= levels) {
        SetBits(&w.step->flags, kLevelsFull);
        level = levels;
      }
      rows->level[i] = level;
      Add(&w.step->remaining, -1);
    });
  }
  Each(levels, [&](int level) { rows->filled[level] = 0; });
  Each(count, [&](int i) {
    if (rows->level[i] < levels) Add(&rows->filled[rows->level[i]], 1);
  });
  Once([&] {
    int block = 0, level = 0;
    for (; level < levels && rows->filled[level] > 0; ++level) {
      rows->begin[level] = block;
      block += (rows->filled[level] + kBlock - 1) / kBlock;
    }
    rows->begin[level] = rows->blocks = block;
    rows->levels = level;
  });
  Each(rows->blocks * kBlock, [&](int place) { rows->order[place] = -1; });
  Each(rows->levels, [&](int level) { rows->filled[level] = 0; });
  Each(count, [&](int i) {
    const int level = rows->level[i];
    if (level >= levels) return;
    int rank = 0;
    for (int j = 0; ranked && j < count; ++j) rank += rows->level[j] == level && rows->key[j] < rows->key[i];
    rows->order[kBlock * rows->begin[level] + (ranked ? rank : Add(&rows->filled[level], 1))] = i;
  });
}

// Calls f(block) for all blocks, level after level.
template <class F>
inline void EachLevel(const Rows& rows, F f) {
  EachBlockOf(rows.begin, rows.levels, f);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_
