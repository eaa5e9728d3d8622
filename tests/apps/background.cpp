#include "background.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <thread>

namespace cadmorph::testing {

namespace fs = std::filesystem;

Background::Background(const fs::path& folder, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {CADMORPH_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> raw;
  for (std::string& word : words) raw.push_back(word.data());
  raw.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "background.err",
                                   O_WRONLY | O_CREAT | O_TRUNC, 0666);
  const int error =
      posix_spawn(&process_, CADMORPH_PROGRAM, &actions, nullptr, raw.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw std::runtime_error("can't run the program in the background");
}

Background::~Background() {
  if (process_ <= 0) return;
  const auto left = readers();
  send(SIGKILL);
  wait();
  for (const pid_t reader : left) kill(reader, SIGKILL);
}

std::vector<pid_t> Background::readers() const {
  std::vector<pid_t> found;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (!std::ranges::all_of(name, [](unsigned char c) { return std::isdigit(c); })) continue;
    const pid_t process = std::stoi(name);
    if (parent_of(process) == process_) found.push_back(process);
  }
  return found;
}

void Background::send(int signal) const { kill(process_, signal); }

int Background::wait() {
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

bool wait_for(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

pid_t parent_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string text;
  std::getline(file, text);
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos || text.size() < name_end + 4) return 0;
  if (text[name_end + 2] == 'Z') return 0;
  return std::stoi(text.substr(name_end + 4));
}

}  // namespace cadmorph::testing
