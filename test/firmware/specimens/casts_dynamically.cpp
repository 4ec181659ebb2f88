// Must not compile: firmware has no run-time type information.
struct Base {
  virtual ~Base() = default;
};
struct Derived : Base {};

const Derived* as_derived(const Base& base) { return dynamic_cast<const Derived*>(&base); }
