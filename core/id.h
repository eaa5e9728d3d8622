#pragma once

#include <compare>
#include <concepts>
#include <cstddef>
#include <vector>

namespace cadmorph {

/// The number of a thing of one kind, counted from 0; -1 is none. It can be read as a plain number,
/// but a number or an Id of another kind becomes one only where that is written: FaceId(7).
template <class Kind>
class Id {
 public:
  constexpr Id() = default;
  constexpr explicit Id(std::integral auto number) : number_(static_cast<int>(number)) {}
  constexpr operator int() const { return number_; }  // NOLINT(google-explicit-constructor)
  constexpr Id& operator++() {
    ++number_;
    return *this;
  }

  template <class Archive>
  void serialize(Archive& archive) {
    archive(number_);
  }

 private:
  int number_ = -1;
};

template <class A, class B>
requires(!std::same_as<A, B>) bool operator==(Id<A>, Id<B>) = delete;
template <class A, class B>
requires(!std::same_as<A, B>) std::strong_ordering operator<=>(Id<A>, Id<B>) = delete;

/// A vector whose places are counted by Ids of one kind, and found by nothing else.
template <class Key, class T>
class IdVector : public std::vector<T> {
 public:
  using std::vector<T>::vector;
  decltype(auto) operator[](Key key) { return std::vector<T>::operator[](place(key)); }
  decltype(auto) operator[](Key key) const { return std::vector<T>::operator[](place(key)); }

  /// All the Ids, to run through: for (const FaceId face : faces.ids()).
  auto ids() const {
    struct Ids {
      struct Iterator {
        Key key;
        Key operator*() const { return key; }
        Iterator& operator++() {
          ++key;
          return *this;
        }
        bool operator!=(const Iterator& other) const { return key != other.key; }
      };
      std::size_t count;
      Iterator begin() const { return {Key(0)}; }
      Iterator end() const { return {Key(count)}; }
    };
    return Ids{this->size()};
  }

 private:
  static std::size_t place(Key key) { return static_cast<std::size_t>(static_cast<int>(key)); }
};

}  // namespace cadmorph
