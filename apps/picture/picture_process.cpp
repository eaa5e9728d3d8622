#include "apps/picture/picture_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "apps/pipeline/output_file.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kLongest{120};  // drawing takes far less; a driver may hang
constexpr const char* kProgram = "cadmorph-picture";
constexpr const char* kLog = "messages";

// The one installed or built beside this program, else the one of the search path.
std::string program() {
  std::error_code error;
  const fs::path beside = fs::read_symlink("/proc/self/exe", error).parent_path() / kProgram;
  return !error && fs::exists(beside, error) ? beside.string() : kProgram;
}

// Starts the program with its messages in a file of the folder; returns 0 or an error number.
int start(const fs::path& folder, pid_t& process) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  const std::string log = folder / kLog;
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  std::string name = program(), option = "--scene", path = folder;
  char* arguments[] = {name.data(), option.data(), path.data(), nullptr};
  const int error = posix_spawnp(&process, name.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

// The first line the program printed, without its name.
std::string message(const fs::path& folder) {
  std::string text = read_bytes(folder / kLog);
  text = text.substr(0, text.find('\n'));
  const std::string prefix = std::string(kProgram) + ": ";
  return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

std::string describe(int status, const fs::path& folder) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  const std::string said = message(folder);
  if (!said.empty()) return said;
  return WIFSIGNALED(status) ? std::string(kProgram) + " ended: " + strsignal(WTERMSIG(status))
                             : std::string(kProgram) + " failed without a message";
}

}  // namespace

// The want of a picture must not cost what it shows.
PictureProcess::PictureProcess(const DrawnMesh& drawn, std::vector<Picture> pictures) {
  try {
    begin(drawn, std::move(pictures));
  } catch (const std::exception& error) {
    failure_ = error.what();
  }
}

PictureProcess::~PictureProcess() {
  if (process_ <= 0) return;
  kill(process_, SIGTERM);
  waitpid(process_, nullptr, 0);
}

void PictureProcess::begin(const DrawnMesh& drawn, std::vector<Picture> pictures) {
  for (const Picture& picture : pictures) names_.push_back(picture.output);
  folder_.emplace();
  write_surfaces(drawn, folder_->path());
  write_scene(folder_->path(), {.cut_axis = drawn.cut_axis, .pictures = std::move(pictures)});
  if (const int error = start(folder_->path(), process_); error != 0) {
    process_ = -1;
    failure_ = std::string("can't start ") + kProgram + ": " + std::strerror(error);
  }
}

DrawnPictures PictureProcess::wait() {
  DrawnPictures result;
  try {
    if (failure_.empty()) failure_ = wait_for_end();
    if (failure_.empty())
      for (const std::string& name : names_)
        result.bytes[name] = read_bytes(folder_->path() / name);
  } catch (const std::exception& error) {
    failure_ = error.what();
    result.bytes.clear();
  }
  result.failure = failure_;
  return result;
}

// Returns what went wrong; empty for nothing.
std::string PictureProcess::wait_for_end() {
  const auto deadline = std::chrono::steady_clock::now() + kLongest;
  int status = 0;
  while (waitpid(process_, &status, WNOHANG) != process_) {
    if (std::chrono::steady_clock::now() > deadline)
      return std::string(kProgram) + " did not end within two minutes";
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  process_ = -1;
  return describe(status, folder_->path());
}

}  // namespace cadmorph
