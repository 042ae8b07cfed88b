// The server has answered the address with its token by a cookie: from here on the token need not be seen any more.
// This takes it out of the address bar and of what is copied from there; a browser may keep the first address in its
// history all the same.
export function hide_token(): void {
  const address = new URL(location.href);
  if (!address.searchParams.has('token')) return;
  address.searchParams.delete('token');
  history.replaceState(null, '', address);
}
