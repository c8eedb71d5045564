// Colors rows so that rows of a color have no common vertex, with the same result as `Coloring`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

constexpr Key kNoKey = ~Key{0};

// Key of a row: the hash of its vertices, then a number that is unique among rows with the same vertices.
inline Key RowKey(const int* vertex, int corners, unsigned number) {
  return static_cast<Key>(RowHash(vertex, corners)) << 32 | number;
}

constexpr int kPointBits = 8;  // Bits of a key that distinguish points of an element.
static_assert(1 << kPointBits == kMostPoints * kMostPoints, "as in AddPoints");

// Returns the color number `rank` among those that `taken` leaves free at the vertices of a row, or -1.
template <class F>
inline int FreeColor(const Environment& w, const int* vertex, int corners, int words, int rank, F counts) {
  for (int word = 0; word < words; ++word) {
    Key taken = 0;
    for (int k = 0; k < corners; ++k) taken |= counts(vertex[k]) ? w.taken[words * vertex[k] + word] : 0;
    Key free = ~taken;
    for (; free && rank > 0; --rank) free &= free - 1;
    if (free) return 64 * word + FirstBit(free);
  }
  return -1;
}

// Colors rows with given `key` and `vertex`: each row gets the first color in which it shares no vertex that `counts`
// with a row of lower key (Jones and Plassmann, 1993). Fills `order`, sorted by key within a color if `ranked`. Rows
// beyond the last color are left out. `rank`: the rank of each row among the points of its element, which have the same
// vertices and get their colors together; null if rows are not points of elements.
template <class F>
inline void ColorRows(const Environment& w, int corners, bool ranked, Rows* rows, F counts, const int* rank = nullptr) {
  constexpr int kNone = -1, kChosen = -2;  // kChosen - color: a color that is not marked as taken yet.
  const int colors = rows->room, words = (colors + 63) / 64, count = rows->count, bits = rank ? kPointBits : 0;
  Each(w.model->padded, [&](int v) {
    for (int k = 0; k < words; ++k) w.taken[words * v + k] = 0;
  });
  Each(count, [&](int i) { rows->color[i] = kNone; });
  Once([&] { w.step->remaining = count; });
  while (w.step->remaining > 0) {
    Each(w.model->padded, [&](int v) { w.best[v] = kNoKey; });
    Each(count, [&](int i) {
      const int* vertex = rows->vertex + corners * i;
      const int color = kChosen - rows->color[i];
      if (color >= 0) rows->color[i] = color;
      for (int k = 0; color >= 0 && color < colors && k < corners; ++k) {
        if (counts(vertex[k])) SetBits(&w.taken[words * vertex[k] + color / 64], Key{1} << color % 64);
      }
      for (int k = 0; rows->color[i] == kNone && k < corners; ++k) {
        if (counts(vertex[k])) TakeLeast(&w.best[vertex[k]], rows->key[i]);
      }
    });
    Each(count, [&](int i) {
      if (rows->color[i] != kNone) return;
      const int* vertex = rows->vertex + corners * i;
      bool first = true;
      for (int k = 0; k < corners; ++k) {
        first = first && (!counts(vertex[k]) || (w.best[vertex[k]] ^ rows->key[i]) >> bits == 0);
      }
      if (!first) return;
      int color = FreeColor(w, vertex, corners, words, rank ? rank[i] : 0, counts);
      if (color < 0 || color >= colors) {
        SetBits(&w.step->flags, kColorsFull);
        color = colors;
      }
      rows->color[i] = kChosen - color;
      Add(&w.step->remaining, -1);
    });
  }
  Each(colors, [&](int color) { rows->filled[color] = 0; });
  Each(count, [&](int i) {
    if (rows->color[i] < 0) rows->color[i] = kChosen - rows->color[i];
    if (rows->color[i] < colors) Add(&rows->filled[rows->color[i]], 1);
  });
  Once([&] {
    int block = 0, color = 0;
    for (; color < colors && rows->filled[color] > 0; ++color) {
      rows->begin[color] = block;
      block += (rows->filled[color] + kBlock - 1) / kBlock;
    }
    rows->begin[color] = rows->blocks = block;
    rows->colors = color;
  });
  Each(rows->blocks * kBlock, [&](int place) { rows->order[place] = -1; });
  Each(rows->colors, [&](int color) { rows->filled[color] = 0; });
  Each(count, [&](int i) {
    const int color = rows->color[i];
    if (color >= colors) return;
    int rank = 0;
    for (int j = 0; ranked && j < count; ++j) rank += rows->color[j] == color && rows->key[j] < rows->key[i];
    rows->order[kBlock * rows->begin[color] + (ranked ? rank : Add(&rows->filled[color], 1))] = i;
  });
}

// Calls f(block) for all blocks, color after color.
template <class F>
inline void EachColor(const Rows& rows, F f) {
  EachBlockOf(rows.begin, rows.colors, f);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_ROWS_H_
