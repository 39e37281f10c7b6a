// What the theme lacks for readers without a pointer: names of its landmarks, boxes that scroll by keyboard.
addEventListener("DOMContentLoaded", () => {
  document.querySelector("aside.sidebar-drawer")?.setAttribute("aria-label", "all pages");
  document.querySelector("aside.toc-drawer")?.setAttribute("aria-label", "this page");
  const reach = () => {
    for (const box of document.querySelectorAll("pre, .table-wrapper")) {
      if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
      else box.removeAttribute("tabindex");
    }
  };
  addEventListener("resize", reach);
  reach();
});
