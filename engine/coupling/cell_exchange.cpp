#include "engine/coupling/cell_exchange.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <map>

#include "engine/particles/parcel.hpp"
#include "engine/threads.hpp"

namespace moraine {

namespace {

/// Values of a cell in each of the halos: volume and exchange to the owners; slip and feel to the windows.
constexpr int widths[4] = {1, 4, 4, 8};
constexpr bool goes_to_owners[4] = {true, true, false, false};

constexpr int wrapped(int i, int n) { return i < 0 ? i + n : i >= n ? i - n : i; }

}  // namespace

CellWindow with_room(const CellWindow& needed, const GridShare& share) {
  CellWindow window = needed;
  for (std::size_t a = 0; a < 3 && !needed.is_empty(); ++a) {
    const int beyond = share.periodic[a] && share.n[a] > 1 ? 1 : 0;
    window.low[a] = std::max(needed.low[a] - 1, -beyond);
    window.high[a] = std::min(needed.high[a] + 1, share.n[a] + beyond);
  }
  return window;
}

std::vector<GridTraffic> exchange_traffic(const std::vector<CellWindow>& windows, const GridShare& share,
                                          bool moves_gas) {
  std::vector<GridTraffic> traffic(windows.size());
  for (std::size_t rank = 0; rank < windows.size(); ++rank) {
    const CellWindow& window = windows[rank];
    std::map<std::size_t, std::int64_t> cells;  // of the window, by owner
    for (int k = window.low[2]; k < window.high[2]; ++k)
      for (int j = window.low[1]; j < window.high[1]; ++j)
        cells[static_cast<std::size_t>(share.owner(wrapped(j, share.n[1]), wrapped(k, share.n[2])))] += window.size(0);
    for (const auto& [owner, n] : cells) {
      if (owner == rank || n <= 0) continue;
      for (std::size_t kind = 0; kind < std::size(widths); ++kind) {
        if (goes_to_owners[kind] && !moves_gas) continue;
        const std::int64_t bytes = n * widths[kind] * static_cast<std::int64_t>(sizeof(double));
        traffic[goes_to_owners[kind] ? rank : owner] += {1, 0, bytes, 0};
        traffic[goes_to_owners[kind] ? owner : rank] += {0, 1, 0, bytes};
      }
    }
  }
  return traffic;
}

CellExchange::CellExchange(World world, GridShare share, int n_threads)
    : world_(std::move(world)), share_(std::move(share)), n_threads_(n_threads), block_(share_.block(world_.rank())) {}

bool CellExchange::fits(const CellWindow& needed) const {
  if (needed.is_empty()) return true;
  return window_.contains(needed) && window_.n_cells() <= 2 * needed.n_cells() + 4096;
}

CellExchange::Piece CellExchange::piece_of(const CellWindow& window, int owner, int other) const {
  Piece piece{other, window, {}};
  if (window.is_empty()) return piece;
  const CellBlock block = share_.block(owner);
  for (int k = window.low[2]; k < window.high[2]; ++k)
    for (int j = window.low[1]; j < window.high[1]; ++j)
      if (block.contains(0, wrapped(j, share_.n[1]), wrapped(k, share_.n[2]))) piece.lines.push_back({j, k});
  return piece;
}

std::vector<int> CellExchange::owners_of(const CellWindow& window) const {
  std::vector<int> owners;
  if (window.is_empty()) return owners;
  for (int k = window.low[2]; k < window.high[2]; ++k)
    for (int j = window.low[1]; j < window.high[1]; ++j)
      owners.push_back(share_.owner(wrapped(j, share_.n[1]), wrapped(k, share_.n[2])));
  std::sort(owners.begin(), owners.end());
  owners.erase(std::unique(owners.begin(), owners.end()), owners.end());
  return owners;
}

void CellExchange::open(const CellWindow& needed) {
  window_ = with_room(needed, share_);
  local_ = piece_of(window_, world_.rank(), world_.rank());
  to_owner_.clear();
  from_.clear();
  std::vector<Parcel> parcels;
  for (const int owner : owners_of(window_)) {
    if (owner == world_.rank()) continue;
    to_owner_.push_back(piece_of(window_, owner, owner));
    ParcelWriter parcel;
    parcel.put(window_);
    parcels.push_back({owner, parcel.take()});
  }
  if (world_.is_alone()) return;
  for (const Parcel& parcel : world_.exchange(std::move(parcels)))
    from_.push_back(piece_of(ParcelReader(parcel.bytes).get<CellWindow>(), world_.rank(), parcel.rank));
  open_halos();
}

void CellExchange::open_halos() {
  std::map<int, std::size_t> link_of_rank;
  std::vector<std::array<std::int64_t, 2>> cells;  // of each link: in this rank's window, in this rank's block
  std::vector<int> ranks;
  const auto link = [&](int rank) {
    const auto [found, is_new] = link_of_rank.try_emplace(rank, ranks.size());
    if (is_new) {
      ranks.push_back(rank);
      cells.push_back({0, 0});
    }
    return found->second;
  };
  owner_link_.clear();
  from_link_.clear();
  for (const Piece& piece : to_owner_) {
    owner_link_.push_back(link(piece.rank));
    cells[owner_link_.back()][0] = piece.n_cells();
  }
  for (const Piece& piece : from_) {
    from_link_.push_back(link(piece.rank));
    cells[from_link_.back()][1] = piece.n_cells();
  }
  for (int kind = 0; kind < n_kinds; ++kind) {
    std::vector<Halo::Link> links;
    for (std::size_t l = 0; l < ranks.size(); ++l) {
      const auto bytes = [&](std::size_t side) { return static_cast<std::size_t>(cells[l][side] * widths[kind] * 8); };
      links.push_back({ranks[l], bytes(goes_to_owners[kind] ? 0 : 1), bytes(goes_to_owners[kind] ? 1 : 0)});
    }
    halos_[kind].open(world_, std::move(links));
  }
}

Halo& CellExchange::halo_of(int width, bool is_to_owners) {
  int kind = 0;
  while (widths[kind] != width || goes_to_owners[kind] != is_to_owners) ++kind;
  return halos_[kind];
}

template <typename Function>
void CellExchange::each_run(const Piece& piece, std::size_t number, Function f) const {
  const auto [j, k] = piece.lines[number];
  const int n = share_.n[0];
  const std::int64_t window_line = piece.window.line(j, k) - piece.window.low[0];
  const std::int64_t row = std::int64_t{wrapped(k, share_.n[2]) - block_.low[2]} * block_.size(1) +
                           (wrapped(j, share_.n[1]) - block_.low[1]);
  for (int i = piece.window.low[0]; i < piece.window.high[0];) {
    const int end = std::min(piece.window.high[0], i < 0 ? 0 : i < n ? n : n + n);
    f(window_line + i, row * n + wrapped(i, n), end - i);
    i = end;
  }
}

template <typename Function>
void CellExchange::each_line(const Piece& piece, Function f) const {
  parallel(n_threads_, [&](int thread) {
    const Range lines = share_of(static_cast<std::int64_t>(piece.lines.size()), thread, n_threads_);
    for (std::int64_t l = lines.begin; l < lines.end; ++l) f(static_cast<std::size_t>(l));
  });
}

void CellExchange::pack_window(const Piece& piece, int width, const std::int64_t* values, std::int64_t* to) const {
  const std::int64_t n = std::int64_t{piece.window.size(0)} * width;
  for (std::size_t l = 0; l < piece.lines.size(); ++l)
    std::memcpy(to + static_cast<std::int64_t>(l) * n,
                values + piece.window.line(piece.lines[l][0], piece.lines[l][1]) * width,
                static_cast<std::size_t>(n) * sizeof *to);
}

void CellExchange::unpack_window(const Piece& piece, int width, const double* from, double* values) const {
  const std::int64_t n = std::int64_t{piece.window.size(0)} * width;
  for (std::size_t l = 0; l < piece.lines.size(); ++l)
    std::memcpy(values + piece.window.line(piece.lines[l][0], piece.lines[l][1]) * width,
                from + static_cast<std::int64_t>(l) * n, static_cast<std::size_t>(n) * sizeof *from);
}

void CellExchange::to_owners(int width, const std::int64_t* window_values, std::int64_t* block_values) {
  Halo& halo = halo_of(width, true);
  for (std::size_t p = 0; p < to_owner_.size(); ++p)
    pack_window(to_owner_[p], width, window_values,
                reinterpret_cast<std::int64_t*>(halo.outgoing(owner_link_[p]).data()));
  if (!world_.is_alone()) halo.start();
  const auto add = [&](const Piece& piece, const std::int64_t* from, std::size_t line, std::int64_t shift) {
    each_run(piece, line, [&](std::int64_t in_window, std::int64_t in_block, std::int64_t n) {
      for (std::int64_t c = 0; c < n * width; ++c)
        block_values[in_block * width + c] += from[(in_window + shift) * width + c];
    });
  };
  // lines of a window that is wider than the grid meet the same cells: those are done one after the other
  if (window_.size(1) > share_.n[1] || window_.size(2) > share_.n[2])
    for (std::size_t line = 0; line < local_.lines.size(); ++line) add(local_, window_values, line, 0);
  else
    each_line(local_, [&](std::size_t line) { add(local_, window_values, line, 0); });
  if (world_.is_alone()) return;
  halo.finish();
  for (std::size_t p = 0; p < from_.size(); ++p) {
    const Piece& piece = from_[p];
    const auto* const values = reinterpret_cast<const std::int64_t*>(halo.incoming(from_link_[p]).data());
    for (std::size_t line = 0; line < piece.lines.size(); ++line)
      add(piece, values, line,
          static_cast<std::int64_t>(line) * piece.window.size(0) -
              piece.window.line(piece.lines[line][0], piece.lines[line][1]));
  }
}

void CellExchange::to_windows(int width, const double* block_values, double* window_values) {
  Halo& halo = halo_of(width, false);
  const auto size = static_cast<std::size_t>(width) * sizeof(double);
  for (std::size_t p = 0; p < from_.size(); ++p) {
    const Piece& piece = from_[p];
    auto* const values = reinterpret_cast<double*>(halo.outgoing(from_link_[p]).data());
    each_line(piece, [&](std::size_t line) {
      const std::int64_t shift = static_cast<std::int64_t>(line) * piece.window.size(0) -
                                 piece.window.line(piece.lines[line][0], piece.lines[line][1]);
      each_run(piece, line, [&](std::int64_t in_window, std::int64_t in_block, std::int64_t n) {
        std::memcpy(values + (in_window + shift) * width, block_values + in_block * width,
                    static_cast<std::size_t>(n) * size);
      });
    });
  }
  if (!world_.is_alone()) halo.start();
  each_line(local_, [&](std::size_t line) {
    each_run(local_, line, [&](std::int64_t in_window, std::int64_t in_block, std::int64_t n) {
      std::memcpy(window_values + in_window * width, block_values + in_block * width,
                  static_cast<std::size_t>(n) * size);
    });
  });
  if (world_.is_alone()) return;
  halo.finish();
  for (std::size_t p = 0; p < to_owner_.size(); ++p)
    unpack_window(to_owner_[p], width, reinterpret_cast<const double*>(halo.incoming(owner_link_[p]).data()),
                  window_values);
}

std::size_t CellExchange::memory() const {
  std::int64_t cells = 0;
  for (const Piece& piece : to_owner_) cells += piece.n_cells();
  for (const Piece& piece : from_) cells += piece.n_cells();
  std::int64_t values = 0;
  for (const int width : widths) values += width;
  return static_cast<std::size_t>(cells * values) * sizeof(double);
}

}  // namespace moraine
