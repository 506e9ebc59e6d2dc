#include "comm/world.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <climits>
#include <cstdlib>
#include <stdexcept>

#include "comm/mpi.hpp"
#include "comm/wait.hpp"

namespace moraine {

namespace {

/// Exchanges take turns with two tags: a rank that is through with one may be sending the parcels of the next while another still
/// looks for those of the first. Nobody can be two ahead.
constexpr std::array<int, 2> parcel_tags = {1, 3};

/// MPI counts in int; nothing that Moraine sends at once comes near, and where it does it says so.
int count_of(std::size_t n) {
  if (n > INT_MAX) throw std::runtime_error("a message of more than 2 GB between ranks: use more ranks");
  return static_cast<int>(n);
}

/// A collective call that has been started, until it is done.
template <typename Start>
void complete(Start start) {
  MPI_Request request = MPI_REQUEST_NULL;
  start(&request);
  wait_for(request);
}

/// Adds its lifetime to a sum [s].
class Timed {
 public:
  explicit Timed(double& sum) : sum_(sum) {}
  ~Timed() { sum_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;

 private:
  double& sum_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

struct World::Group {
  MPI_Comm communicator = MPI_COMM_NULL;
  bool ends_mpi = false;
  int rank = 0, size = 1;
  unsigned n_exchanges = 0;
  WorldTimes times;

  Group(MPI_Comm comm, bool is_last) : communicator(comm), ends_mpi(is_last) {
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &size);
  }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;
  ~Group() {
    int is_over = 0;
    MPI_Finalized(&is_over);
    if (is_over) return;
    MPI_Comm_free(&communicator);
    if (ends_mpi) MPI_Finalize();
  }
};

bool World::is_launched() {
  // Open MPI's mpirun, and Slurm with PMIx or PMI-2.
  return std::getenv("OMPI_COMM_WORLD_SIZE") || std::getenv("PMIX_RANK") || std::getenv("PMI_RANK");
}

World World::join() {
  if (!is_launched()) return {};
  int provided = 0, is_running = 0;
  MPI_Initialized(&is_running);  // by who has loaded us (mpi4py): then MPI is theirs to end
  if (is_running)
    MPI_Query_thread(&provided);
  else
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  if (provided < MPI_THREAD_FUNNELED)
    throw std::runtime_error("this MPI library does not allow threads: Moraine needs MPI_THREAD_FUNNELED");
  MPI_Comm own;
  MPI_Comm_dup(MPI_COMM_WORLD, &own);
  return World(std::make_shared<Group>(own, !is_running));
}

int World::rank() const { return group_ ? group_->rank : 0; }
int World::size() const { return group_ ? group_->size : 1; }
const void* World::communicator() const { return group_ && group_->size > 1 ? &group_->communicator : nullptr; }

std::optional<World> World::first(int n) const {
  if (is_alone()) return n >= 1 ? std::optional(World()) : std::nullopt;
  const bool is_in = rank() < n;
  MPI_Comm part = MPI_COMM_NULL;
  MPI_Comm_split(group_->communicator, is_in ? 0 : MPI_UNDEFINED, rank(), &part);
  if (!is_in) return std::nullopt;
  return World(std::make_shared<Group>(part, false));
}

void World::max(std::span<double> values) const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallreduce(MPI_IN_PLACE, values.data(), count_of(values.size()), MPI_DOUBLE, MPI_MAX, group_->communicator,
                   request);
  });
}

void World::max(std::span<std::uint64_t> values) const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallreduce(MPI_IN_PLACE, values.data(), count_of(values.size()), MPI_UINT64_T, MPI_MAX, group_->communicator,
                   request);
  });
}

void World::sum(std::span<std::int64_t> values) const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallreduce(MPI_IN_PLACE, values.data(), count_of(values.size()), MPI_INT64_T, MPI_SUM, group_->communicator,
                   request);
  });
}

void World::sum(std::span<std::uint64_t> values) const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallreduce(MPI_IN_PLACE, values.data(), count_of(values.size()), MPI_UINT64_T, MPI_SUM, group_->communicator,
                   request);
  });
}

std::uint64_t World::sum_before(std::uint64_t value) const {
  if (is_alone()) return 0;
  const Timed timed(group_->times.reductions);
  std::uint64_t before = 0;
  complete([&](MPI_Request* request) {
    MPI_Iexscan(&value, &before, 1, MPI_UINT64_T, MPI_SUM, group_->communicator, request);
  });
  return is_root() ? 0 : before;  // the first rank's is not defined
}

std::vector<std::uint64_t> World::gather(std::uint64_t value) const {
  std::vector<std::uint64_t> all(static_cast<std::size_t>(size()), value);
  if (is_alone()) return all;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallgather(&value, 1, MPI_UINT64_T, all.data(), 1, MPI_UINT64_T, group_->communicator, request);
  });
  return all;
}

std::vector<double> World::gather(double value) const {
  std::vector<double> all(static_cast<std::size_t>(size()), value);
  if (is_alone()) return all;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) {
    MPI_Iallgather(&value, 1, MPI_DOUBLE, all.data(), 1, MPI_DOUBLE, group_->communicator, request);
  });
  return all;
}

std::vector<double> World::gather(std::span<const double> values) const {
  std::vector<double> all(values.size() * static_cast<std::size_t>(size()));
  if (is_alone()) return {values.begin(), values.end()};
  const Timed timed(group_->times.reductions);
  const int n = count_of(values.size());
  complete([&](MPI_Request* request) {
    MPI_Iallgather(values.data(), n, MPI_DOUBLE, all.data(), n, MPI_DOUBLE, group_->communicator, request);
  });
  return all;
}

std::vector<std::string> World::gather_at_root(const std::string& text) const {
  if (is_alone()) return {text};
  std::vector<Parcel> parcels(1);
  const auto* const bytes = reinterpret_cast<const std::byte*>(text.data());
  parcels[0].bytes.assign(bytes, bytes + text.size());
  std::vector<std::string> texts;
  for (const Parcel& parcel : exchange(std::move(parcels)))
    texts.emplace_back(reinterpret_cast<const char*>(parcel.bytes.data()), parcel.bytes.size());
  return texts;
}

void World::broadcast(std::vector<std::byte>& bytes, int root) const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  std::uint64_t size = bytes.size();
  complete([&](MPI_Request* request) { MPI_Ibcast(&size, 1, MPI_UINT64_T, root, group_->communicator, request); });
  bytes.resize(size);
  constexpr std::uint64_t most = std::uint64_t{1} << 30;
  for (std::uint64_t done = 0; done < size; done += most)
    complete([&](MPI_Request* request) {
      MPI_Ibcast(bytes.data() + done, static_cast<int>(std::min(most, size - done)), MPI_BYTE, root,
                 group_->communicator, request);
    });
}

void World::broadcast(std::string& text, int root) const {
  if (is_alone()) return;
  const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
  std::vector<std::byte> bytes(begin, begin + text.size());
  broadcast(bytes, root);
  text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

std::vector<Parcel> World::exchange(std::vector<Parcel> parcels) const {
  if (is_alone()) return parcels;
  const Timed timed(group_->times.parcels);
  const MPI_Comm comm = group_->communicator;
  const int parcel_tag = parcel_tags[group_->n_exchanges++ % parcel_tags.size()];
  std::vector<Parcel> arrived;
  std::vector<MPI_Request> sending;
  for (Parcel& parcel : parcels) {
    if (parcel.rank == rank()) {
      arrived.push_back(std::move(parcel));
      continue;
    }
    // Synchronous: done only when it is being received, so that "all mine are done" means "all mine have arrived".
    sending.emplace_back();
    MPI_Issend(parcel.bytes.data(), count_of(parcel.bytes.size()), MPI_BYTE, parcel.rank, parcel_tag, comm,
               &sending.back());
  }
  MPI_Request everyone = MPI_REQUEST_NULL;
  bool is_waiting_for_everyone = false;
  const auto since = std::chrono::steady_clock::now();
  for (unsigned n_times = 0;;) {
    int has_come = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, parcel_tag, comm, &has_come, &status);
    if (has_come) {
      int n = 0;
      MPI_Get_count(&status, MPI_BYTE, &n);
      Parcel parcel{status.MPI_SOURCE, std::vector<std::byte>(static_cast<std::size_t>(n))};
      MPI_Recv(parcel.bytes.data(), n, MPI_BYTE, parcel.rank, parcel_tag, comm, MPI_STATUS_IGNORE);
      arrived.push_back(std::move(parcel));
      n_times = 0;
      continue;
    }
    int is_done = 0;
    if (is_waiting_for_everyone) {
      MPI_Test(&everyone, &is_done, MPI_STATUS_IGNORE);
      if (is_done) break;
    } else {
      MPI_Testall(static_cast<int>(sending.size()), sending.data(), &is_done, MPI_STATUSES_IGNORE);
      if (is_done) {
        MPI_Ibarrier(comm, &everyone);
        is_waiting_for_everyone = true;
        continue;
      }
    }
    be_patient(n_times++);
  }
  add_waited(std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count());
  // A rank's own messages keep their order; those of different ranks come as they like.
  std::stable_sort(arrived.begin(), arrived.end(), [](const Parcel& x, const Parcel& y) { return x.rank < y.rank; });
  return arrived;
}

void World::wait_for_all() const {
  if (is_alone()) return;
  const Timed timed(group_->times.reductions);
  complete([&](MPI_Request* request) { MPI_Ibarrier(group_->communicator, request); });
}

WorldTimes World::times() const { return group_ ? group_->times : WorldTimes(); }

void World::abort(int code) const {
  if (group_) MPI_Abort(group_->communicator, code);
  std::exit(code);
}

}  // namespace moraine
